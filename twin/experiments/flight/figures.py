"""A flight's figures in the terms of rocketry."""

from dataclasses import asdict, dataclass

from twin.config.result import Rows

STRAIGHT_M = 1e5  # a smallest turn of a larger radius is none


@dataclass(frozen=True)
class Figures:
    """A flight in the terms of rocketry; None where it has no meaning for this flight.

    Velocities and positions are those of the gimbal pivot; heights are above the launch point.

    Attributes
    ----------
    rail_exit_s, rail_exit_speed_m_s : when the lower lug leaves the rail
    burnout_s, burnout_height_m, burnout_speed_m_s : at the end of thrust
    apogee_m, apogee_s : highest point and its time; None where the flight ended before it
    max_ascent_speed_m_s : up to the apogee
    max_acceleration_m_s2 : up to the apogee, mean over a control period
    max_mach, max_dynamic_pressure_pa : of the ascent, in the standard atmosphere
    rail_exit_angle_of_attack_deg : at the first tick off the rail
    max_angle_of_attack_deg : of the ascent after the rail, where `analysis.flown.fast` has it count
    gimbal_saturation : share of the burn in which a command is at the limit of its axis
    control_margin : share of the stroke that the larger of both commands leaves in 95 % of the burn
    turn_radius_m : smallest of the path under power in free flight, over `rocketry.TURN` seconds:
        way over change of its direction (1 over the mean curvature; E. Kreyszig, Advanced
        Engineering Mathematics, 10th ed., §9.5); None without a gimbal or where the motor burned
        no longer
    downrange_m : level distance from the launch point at the end
    end_east_m, end_north_m : the place of the end, from the launch point
    impact_speed_m_s : at the last tick before the ground; None where it was not reached
    """

    rail_exit_s: float | None
    rail_exit_speed_m_s: float | None
    rail_exit_angle_of_attack_deg: float | None
    burnout_s: float | None
    burnout_height_m: float | None
    burnout_speed_m_s: float | None
    apogee_m: float | None
    apogee_s: float | None
    max_ascent_speed_m_s: float
    max_acceleration_m_s2: float | None
    max_mach: float
    max_dynamic_pressure_pa: float
    max_angle_of_attack_deg: float | None
    gimbal_saturation: float | None
    control_margin: float | None
    turn_radius_m: float | None
    downrange_m: float
    end_east_m: float
    end_north_m: float
    impact_speed_m_s: float | None

    def as_dict(self) -> dict[str, object]:
        """JSON values, in SI units unless the name gives another."""
        return asdict(self)

    def rows(self, slant_range: float | None) -> Rows:
        """The figures as a table; `slant_range` at burnout [m]."""
        rows = []
        if self.rail_exit_s is not None:
            off = f"{self.rail_exit_speed_m_s:.1f} m/s at {self.rail_exit_s:.2f} s"
            if self.rail_exit_angle_of_attack_deg is not None:
                off += f", angle of attack {self.rail_exit_angle_of_attack_deg:.1f}°"
            rows.append(("off the rail", off))
        if self.burnout_s is not None:
            place = f"{self.burnout_height_m:.0f} m high, slant range {slant_range:.0f} m"
            motion = f"{self.burnout_speed_m_s:.1f} m/s at {self.burnout_s:.2f} s"
            rows.append(("burnout", f"{motion}, {place}"))
        if self.apogee_m is not None:
            rows.append(("apogee", f"{self.apogee_m:.1f} m at {self.apogee_s:.2f} s"))
        most = [f"{self.max_ascent_speed_m_s:.1f} m/s (Mach {self.max_mach:.2f})"]
        if self.max_acceleration_m_s2 is not None:
            most.append(f"{self.max_acceleration_m_s2:.1f} m/s²")
        most.append(f"{self.max_dynamic_pressure_pa:.0f} Pa dynamic pressure")
        rows.append(("ascent, at most", ", ".join(most)))
        if self.max_angle_of_attack_deg is not None:
            attack = f"angle of attack {self.max_angle_of_attack_deg:.2f}°"
            rows.append(("", f"{attack}, from a third of the largest airspeed on"))
        if self.gimbal_saturation is not None:
            rows.append(("gimbal at limit", f"{100 * self.gimbal_saturation:.1f} % of the burn"))
        if self.control_margin is not None:
            left = f"{100 * self.control_margin:.0f} % or more of the stroke, in 95 % of the burn"
            rows.append(("stroke left", left))
        if self.turn_radius_m is not None and self.turn_radius_m < STRAIGHT_M:
            rows.append(("smallest turn", f"{self.turn_radius_m:.0f} m radius under power"))
        end = (
            f"{self.downrange_m:.0f} m ({self.end_east_m:.0f} m east, {self.end_north_m:.0f} north)"
        )
        if self.impact_speed_m_s is not None:
            end += f", impact at {self.impact_speed_m_s:.1f} m/s"
        return [*rows, ("downrange", end)]
