"""What the viewer shows of a recording: views, plots, states, colours."""
