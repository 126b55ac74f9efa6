"""Everything between a computer and a gimbal on the desk; needs neither MuJoCo nor the twin."""
