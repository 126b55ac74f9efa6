"""Gateway for a Raspberry Pi 3B+: `python -m hardware.raspberry_pi`."""
