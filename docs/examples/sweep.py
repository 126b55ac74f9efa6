"""Parameter sweep: the same flight in more and more wind, and a plot of the paths.

    python docs/examples/sweep.py [FOLDER]

Needs plotly (extra `report`) for the plot.
"""

import sys
from pathlib import Path

import numpy as np
import plotly.graph_objects as go

import twin

WINDS = (0.0, 4.0, 8.0, 12.0)  # m/s at 10 m, from the west


def main(folder):
    """Fly once for every wind, print a table, and write the plot."""
    figure = go.Figure()
    print("wind      height   range    attitude error")
    for wind in WINDS:
        flight = twin.fly(
            gimbal="transfer-function",
            set={"wind_speed": wind, "wind_turbulence": 0.1},
            seed=1,
            duration_s=16.0,
            out=folder / f"wind_{wind:g}.rrd",
        )
        east, north, up = twin.read(flight)["vehicle/position"].values.T
        away = np.hypot(east, north)
        error = flight.attitude_error_rms_deg
        print(f"{wind:4g} m/s {up.max():7.1f} m {away[-1]:6.1f} m {error:8.2f} °")
        figure.add_scatter(x=away[::25], y=up[::25], name=f"{wind:g} m/s", mode="lines")
    figure.update_layout(
        title="Flights in wind", xaxis_title="distance over ground [m]", yaxis_title="height [m]"
    )
    page = folder / "sweep.html"
    figure.write_html(page)
    print(f"plot: {page}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
