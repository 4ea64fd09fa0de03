"""An equatorial mount as it really is: axes, motors, gears, and what is wrong with them."""
