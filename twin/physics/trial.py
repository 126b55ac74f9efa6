"""Compile a model and compute one step of it: `python -m twin.physics.trial`, with limits.

Standard input has a JSON object with the text of an MJCF file, or null, and its path.
"""

import json
import sys

import mujoco

from analysis import limited


def main() -> None:
    """Compile the model on standard input; errors that MuJoCo reports are left to the caller."""
    limited.confine()
    request = json.load(sys.stdin)
    try:
        if request["text"] is None:
            model = mujoco.MjModel.from_xml_path(request["path"])
        else:
            model = mujoco.MjSpec.from_string(request["text"]).compile()
        if 0 < model.opt.timestep < 1:
            mujoco.mj_step(model, mujoco.MjData(model))
    except ValueError as error:  # others will be reported where it is compiled again
        if "allocate memory" in str(error):  # where there may be enough to fill the machine
            limited.refuse("MuJoCo cannot hold it: it needs more memory than a model may")
    except (mujoco.FatalError, MemoryError) as error:
        limited.refuse(f"MuJoCo cannot hold it: {error}")


if __name__ == "__main__":
    main()
