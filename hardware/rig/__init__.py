"""The gimbal seat over a link."""
