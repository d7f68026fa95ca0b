"""The planar slider-crank with a clearance joint between rod and slider; the crank turns at constant speed.

    P = r (cos phi, sin phi),  u = (cos psi, sin psi),  t = (-sin psi, cos psi),  B = P + l u,  S = (x, 0),  e = S - B
    (I_2 + m_2 l^2/4) psi'' = -(m_2 l/2) P''.t - l F.t + M_B - (m_2 l/2) g cos psi,      m_3 x'' = F_x

F is the joint's force on the slider, M_B its moment on the rod. States are the journal's place e in its bearing and
its rate: the indentation, a few micrometres, is the small difference of psi and x, and would have only their
accuracy. psi and x follow from e:  sin psi = -(r sin phi + e_y)/l,  x = r cos phi + l cos psi + e_x.
Masses and lengths: Wang, Liu, Ma, J. Mech. Sci. Tech. 30 (2016) 1537-1545, Table 4. Assumed, as not printed there:
rod's centre of mass at mid-length, no gravity, no guide friction, and the numbers that are marked so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy as sp

from ..door import checks
from ..laws import Law
from ..laws.contact import LiuImpact, composite_modulus
from ..laws.friction import ModifiedCoulomb
from . import sketches
from .drive import OF_CONTACT, OF_FRICTION, t
from .journal import clearance_joint
from .scene import Scene, scene_of

__all__ = ["IdealSliderCrank", "slider_crank"]

CRANK, ROD = 0.05, 0.30  # m
ROD_MASS, ROD_INERTIA, SLIDER_MASS = 1.130, 0.015300, 1.013  # kg, kg m^2, kg
BEARING, LENGTH, MODULUS, POISSON = 0.010, 0.015, 207e9, 0.3  # assumed
RPM, FRICTION = 200.0, 0.01  # assumed

e_x, e_y, u_x, u_y = sp.symbols("e_x e_y u_x u_y", real=True)
omega, r, l, m_2, I_2, m_3, c, R_B, g = sp.symbols("omega r l m_2 I_2 m_3 c R_B g", positive=True)
UNITS = {
    "e_x": "m", "e_y": "m", "u_x": "m/s", "u_y": "m/s", "x": "m", "velocity": "m/s", "acceleration": "m/s^2",
    "psi": "rad", "indentation": "m", "slip": "m/s", "normal": "N", "friction": "N", "torque": "N m",
    "energy": "J",
}  # fmt: skip


_LENGTHS = ("rpm", "crank", "rod", "rod_mass", "rod_inertia", "slider_mass")


@checks.door(
    normal=checks.optional(OF_CONTACT), c_r=checks.number, gravity=checks.number,
    start=checks.pair, **dict.fromkeys(("clearance", "bearing", "revolutions", *_LENGTHS), checks.positive),
)  # fmt: skip
def slider_crank(
    normal: Law | None = None,
    tangential: Law | None | str = "modified Coulomb",
    *,
    clearance: float = 5e-4,
    c_r: float = 0.9,
    rpm: float = RPM,
    bearing: float = BEARING,
    crank: float = CRANK,
    rod: float = ROD,
    rod_mass: float = ROD_MASS,
    rod_inertia: float = ROD_INERTIA,
    slider_mass: float = SLIDER_MASS,
    gravity: float = 0.0,
    start: Sequence[float] = (0.0, 0.0),
    revolutions: float = 1.0,
) -> Scene:
    """The planar slider-crank with a clearance joint between rod and slider; the crank turns at constant speed.

    Parameters
    ----------
    normal : Law, optional
        Contact law; Wang, Liu and Ma's with `c_r` and steel without. A law that has the joint's clearance as a
        parameter must have this one.
    tangential : Law, optional
        Friction law per unit of load; None is none.
    clearance : float, m
        Radial clearance R_B - R_J, > 0 and below the bearing's radius.
    c_r : float, dimensionless
        Coefficient of restitution of the default contact law.
    bearing, crank, rod : float, m
        Radius R_B, and lengths.
    gravity : float, m/s^2
        In the direction of -y.
    start : (float, float), m
        Journal centre in the bearing at phi = 0; it moves with the ideal joint's velocity.
    revolutions : float, dimensionless
        Of the suggested span.

    Returns
    -------
    Scene
        Outputs x, velocity, acceleration (slider), psi, indentation (< 0 in free flight), slip, normal, friction,
        torque, pin_x, pin_y (crank-pin force on the rod), guide (on the slider), energy.

    Raises
    ------
    ValueError
        A clearance, length, mass or speed that is not positive; a journal that is not smaller than its bearing; a
        start inside the wall; a law with another clearance.

    Source: Wang, Liu, Ma, J. Mech. Sci. Tech. 30 (2016) 1537-1545, Table 4, for masses and lengths. Assumed, as not
    printed there: rod's centre of mass, 200 rpm, radii, joint length, steel, friction coefficient 0.01, no gravity.

    The first impact after free flight:

    >>> scene = slider_crank(clearance=1e-3)
    >>> first = scene.solve((0, 0.01)).event_times("reset", "touch-down")[0]
    >>> print(f"{1e3 * first:.6f} ms")
    8.860950 ms
    """
    if not clearance < bearing:
        raise ValueError(
            f"`clearance` is {clearance:g} and `bearing` {bearing:g}; the journal's radius, their difference, must be "
            "positive."
        )
    if not crank + clearance < rod:
        raise ValueError(
            f"`rod` is {rod:g}; it must be longer than crank and clearance, {crank + clearance:g}."
        )
    if math.hypot(*start) >= clearance:
        raise ValueError(
            f"`start` is {math.hypot(*start):g} m from the bearing's centre, on or inside its wall at {clearance:g}; "
            "start in free flight."
        )
    steel = composite_modulus(MODULUS, POISSON)
    if normal is None:
        normal = LiuImpact(E_star=steel, length=LENGTH, clearance=clearance, c_r=c_r)
    elif getattr(normal, "clearance", clearance) != clearance:
        raise ValueError(
            f"`normal` has clearance={normal.clearance:g}, the joint {clearance:g}; give them the same one."  # type: ignore[attr-defined]
        )
    if isinstance(tangential, str):
        tangential = checks.one_of("modified Coulomb")(tangential, "`tangential`, if no law,")
        tangential = ModifiedCoulomb(F_c=FRICTION)
    checks.optional(OF_FRICTION)(tangential, "`tangential`")

    joint, rates, outputs = _equations(normal, tangential, g if gravity else sp.S.Zero)
    values = {omega: 2 * math.pi * rpm / 60, r: crank, l: rod, m_2: rod_mass, I_2: rod_inertia, m_3: slider_mass,
              c: clearance, R_B: bearing}  # fmt: skip
    if gravity:
        values[g] = gravity
    if tangential is None:
        del values[R_B], outputs["slip"]
    period = 60 / rpm
    scene = scene_of(
        "slider-crank", normal, (0.0, revolutions * period), rates, joint.pieces, outputs, period=period, units=UNITS,
        note="masses and lengths: Wang, Liu, Ma 2016, Table 4; centre of mass, crank speed, radii, joint length, "
        f"material and friction assumed. Contact: {normal.source}",
        x0={e_x: start[0], e_y: start[1], u_x: 0.0, u_y: 0.0}, parameters=values, outputs=outputs,
        events=joint.events, sketch=sketches.slider_crank(crank, rod, clearance),
    )  # fmt: skip
    # The indentation is about a hundredth of the clearance, and is wanted to many digits.
    scene.atol.update(e_x=1e-10 * clearance, e_y=1e-10 * clearance)
    return scene


def _equations(normal, tangential, gravity):
    """(joint, rates of e and its rate, outputs) of the mechanism."""
    phi = omega * t
    P = sp.Matrix([r * sp.cos(phi), r * sp.sin(phi)])
    acceleration_P = -(omega**2) * P
    sine = -(r * sp.sin(phi) + e_y) / l
    cosine = sp.sqrt(1 - sine**2)
    spin = -(r * omega * sp.cos(phi) + u_y) / (l * cosine)
    along, across = sp.Matrix([cosine, sine]), sp.Matrix([-sine, cosine])
    joint = clearance_joint(
        (e_x, e_y), (u_x, u_y), c=c, R_B=R_B, R_J=R_B - c, spin_B=spin, normal=normal, tangential=tangential
    )
    F, weight = sp.Matrix(joint.force), m_2 * gravity
    moment = -m_2 * l / 2 * acceleration_P.dot(across) - l * F.dot(across) + joint.moments[1]
    turn = (moment - l / 2 * weight * cosine) / (I_2 + m_2 * l**2 / 4)
    slide = F[0] / m_3
    swing = turn * across - spin**2 * along  # u''
    bearing_acceleration = acceleration_P + l * swing
    rates = {e_x: u_x, e_y: u_y, u_x: slide - bearing_acceleration[0], u_y: -bearing_acceleration[1]}
    pin = m_2 * (acceleration_P + l / 2 * swing) + F + sp.Matrix([0, weight])
    velocity = u_x - r * omega * sp.sin(phi) - l * spin * sine
    centre = omega * sp.Matrix([-P[1], P[0]]) + l / 2 * spin * across
    kinetic = (m_2 * centre.dot(centre) + I_2 * spin**2 + m_3 * velocity**2) / 2
    height = P[1] + l / 2 * sine
    outputs = {
        "x": e_x + P[0] + l * cosine,
        "velocity": velocity,
        "acceleration": slide,
        "psi": sp.asin(sine),
        "indentation": joint.indentation,
        "slip": joint.slip,
        "normal": joint.normal,
        "friction": joint.friction,
        "torque": P[0] * pin[1] - P[1] * pin[0],
        "pin_x": pin[0],
        "pin_y": pin[1],
        "guide": -F[1],
        "energy": kinetic + joint.pieces[0].outputs.get("stored", sp.S.Zero) + weight * height,
    }
    return joint, rates, outputs


@checks.door()
class IdealSliderCrank:
    """The same mechanism with an ideal joint, in closed form over the crank angle.

    Parameters
    ----------
    crank, rod : float, m
        Lengths.

    Source: the kinematics of the slider-crank; the torque is the rate of the kinetic energy with the crank angle.

    At phi = 0 the slider's acceleration is -omega^2 r (1 + r/l):

    >>> ideal = IdealSliderCrank()
    >>> print(f"{ideal.acceleration(0.0):.3f} {-ideal.omega**2 * ideal.r * (1 + ideal.r / ideal.l):.3f}")
    -25.588 -25.588
    """

    @checks.door(**dict.fromkeys(_LENGTHS, checks.positive))
    def __init__(self, *, rpm: float = RPM, crank: float = CRANK, rod: float = ROD, rod_mass: float = ROD_MASS,
                 rod_inertia: float = ROD_INERTIA, slider_mass: float = SLIDER_MASS) -> None:  # fmt: skip
        self.omega, self.r, self.l = 2 * math.pi * rpm / 60, crank, rod
        self.m_2, self.I_2, self.m_3 = rod_mass, rod_inertia, slider_mass

    def _rod(self, phi):
        """sin, cos of psi, and its first two derivatives by phi."""
        ratio = self.r / self.l
        sine = -ratio * np.sin(phi)
        cosine = np.sqrt(1 - sine**2)
        first = -ratio * np.cos(phi) / cosine
        second = (ratio * np.sin(phi) + first**2 * sine) / cosine
        return sine, cosine, first, second

    def position(self, phi: Any) -> Any:
        """Position of the slider.

        Returns
        -------
        float or ndarray
            x, of the shape of `phi`, m.
        """
        return self.r * np.cos(phi) + self.l * self._rod(phi)[1]

    def velocity(self, phi: Any) -> Any:
        """Velocity of the slider.

        Returns
        -------
        float or ndarray
            dx/dt, of the shape of `phi`, m/s.
        """
        sine, _, first, _ = self._rod(phi)
        return self.omega * (-self.r * np.sin(phi) - self.l * sine * first)

    def acceleration(self, phi: Any) -> Any:
        """Acceleration of the slider.

        Returns
        -------
        float or ndarray
            d2x/dt2, of the shape of `phi`, m/s^2.
        """
        sine, cosine, first, second = self._rod(phi)
        return self.omega**2 * (-self.r * np.cos(phi) - self.l * (cosine * first**2 + sine * second))

    def torque(self, phi: Any) -> Any:
        """Driving torque at constant speed: d(kinetic energy)/d phi.

        Returns
        -------
        float or ndarray
            Of the shape of `phi`, N m.
        """
        sine, cosine, first, second = self._rod(phi)
        w2 = self.omega**2
        # Centre of mass: r (cos, sin) + (l/2) (cos psi, sin psi)
        vx = -self.r * np.sin(phi) - self.l / 2 * sine * first
        vy = self.r * np.cos(phi) + self.l / 2 * cosine * first
        ax = -self.r * np.cos(phi) - self.l / 2 * (cosine * first**2 + sine * second)
        ay = -self.r * np.sin(phi) + self.l / 2 * (cosine * second - sine * first**2)
        rod = w2 * (self.m_2 * (vx * ax + vy * ay) + self.I_2 * first * second)
        return rod + self.m_3 * self.velocity(phi) / self.omega * self.acceleration(phi)
