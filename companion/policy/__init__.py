"""Which five waypoints lead past the hazard?"""
