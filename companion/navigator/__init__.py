"""One tick, pure: memory and inputs in, memory, setpoint and record out."""
