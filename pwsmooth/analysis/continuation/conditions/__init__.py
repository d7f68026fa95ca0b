"""What holds at a bifurcation of an orbit: a multiplier on the unit circle, a touch, a capture, chatter."""
