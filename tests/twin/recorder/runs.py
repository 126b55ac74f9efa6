"""A short made-up flight for tests of the recording side: known values, no physics."""

from pathlib import Path

import mujoco
import numpy as np

from twin.recorder import Recorder

SCENE = """
<mujoco>
  <worldbody>
    <geom type="plane" size="0 0 1" rgba="0.35 0.42 0.33 1"/>
    <geom type="box" pos="-0.5 0 0.7" size="0.02 0.02 0.7" rgba="0.4 0.4 0.4 1"/>
    <body name="vehicle" pos="0 0 0.3">
      <freejoint name="vehicle"/>
      <geom type="cylinder" size="0.027 0.35" pos="0 0 0.42" rgba="0.85 0.1 0.1 1"/>
      <geom type="ellipsoid" size="0.027 0.027 0.16" pos="0 0 0.77" rgba="0.85 0.1 0.1 1"/>
      <geom type="capsule" size="0.05 0.3" group="3" rgba="0 0 1 1"/>
      <body name="gimbal_ring">
        <joint name="gimbal_x" axis="1 0 0"/>
        <geom type="cylinder" size="0.024 0.004" rgba="0.2 0.6 0.9 1"/>
        <body name="gimbal_holder">
          <joint name="gimbal_y" axis="0 1 0"/>
          <geom type="cylinder" size="0.0145 0.1" pos="0 0 -0.05" rgba="0.2 0.2 0.25 1"/>
          <site name="gimbal_nozzle" pos="0 0 -0.15"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

SIGNALS = (
    "gimbal/command",
    "gimbal/simulated",
    "gimbal/measured",
    "gimbal/sigma",
    "gimbal/rate/simulated",
    "vehicle/position",
    "vehicle/velocity",
    "vehicle/attitude",
    "vehicle/rate",
    "vehicle/mass",
    "vehicle/thrust",
    "vehicle/airspeed",
    "vehicle/tilt",
    "control/setpoint",
    "control/error",
    "timing/lateness",
    "linkage/closure",
    "linkage/servo",
)
PERIOD_NS = 4_000_000
EPOCH_NS = 1_700_000_000_000_000_000


def fly(path: Path, seconds: float, *, wall_offset: int = 0, fail_at: float = np.inf) -> None:
    """Record an accelerating climb with a swinging gimbal; raises at `fail_at` seconds."""
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    properties = {"seed": 7, "configuration": {"motor": "H13", "gain": 0.1}}
    with Recorder(path, signals=SIGNALS, properties=properties, model=model) as recorder:
        recorder.event(0, "ignition")
        for tick in range(round(seconds * 1e9) // PERIOD_NS):
            time_ns = tick * PERIOD_NS
            if time_ns * 1e-9 >= fail_at:
                raise RuntimeError("the plant exploded")
            fill(recorder, time_ns * 1e-9, data)
            mujoco.mj_kinematics(model, data)
            recorder.commit(time_ns, EPOCH_NS + wall_offset + time_ns)
            recorder.commit_pose(time_ns, data)


def fill(recorder: Recorder, time: float, data: mujoco.MjData) -> None:
    row, at = recorder.row, recorder.slices
    row[:] = 0.0
    row[at["gimbal/command"]] = command = angle(time)
    row[at["gimbal/simulated"]] = simulated = angle(time - 0.05)
    row[at["gimbal/measured"]] = np.nan if time < 0.1 else simulated + 0.002
    row[at["control/error"]] = command - simulated
    row[at["vehicle/thrust"]] = 14.0
    tilt = 0.2 + 0.15 * np.sin(0.8 * time)
    data.qpos[:3] = [0.3 * time**2, 0.5 * time, 0.3 + 2.0 * time**2]
    data.qpos[3:7] = [np.cos(tilt / 2), 0.0, np.sin(tilt / 2), 0.0]
    data.qpos[7:9] = simulated
    row[at["vehicle/position"]] = data.qpos[:3]
    row[at["vehicle/attitude"]] = data.qpos[3:7]


def angle(time: float) -> np.ndarray:
    return np.radians([5.0 * np.sin(2.0 * time), 3.0 * np.cos(1.3 * time)])
