"""From commands, gyro and potentiometer to a continuous-time model with honest uncertainty."""
