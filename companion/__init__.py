"""What flies on the drone: reads vehicle state and LiDAR, sends offboard position setpoints."""
