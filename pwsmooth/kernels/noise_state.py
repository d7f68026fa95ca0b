"""What the noise kernels are told: plain numbers, no objects."""

from .block import Bundle

KICKS = 0x6B69636B  # word of the counter that belongs to kicks alone


class Kick(Bundle):
    """One sequence of kicks."""

    act: "int"  # address of the model's own function
    index: "int"  # number of the event that kicks
    every: "float"
    normal: "int"  # 1: standard normal, 0: uniform
    seed: "int"
    trajectory: "int"
    where: "i8[1]"  # states that are kicked
    size: "f8[1]"
