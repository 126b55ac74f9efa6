"""Servos of bounded speed, with dead band and backlash: motion, search, fit."""
