"""Interface between a computer and a gimbal rig; needs neither MuJoCo nor the twin."""
