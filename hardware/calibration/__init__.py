"""Calibration of one rig."""
