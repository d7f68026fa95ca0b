"""What the kernel that keeps deviations orthonormal is told, and what it gives; the frame itself is Tangent.w."""

from ..machine.block import Bundle


class Frame(Bundle):
    """Logarithms of what the directions of a frame have grown by, factor by factor."""

    replay: "int"  # address of that unit
    count: "int"  # directions: the first columns
    entries: "int"  # of the tape
    factors: "int"
    t: "f8[:]"  # ends of the factors
    log: "f8[:, :]"
