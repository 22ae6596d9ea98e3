"""Which setpoint follows the line, the path or the landing profile?"""
