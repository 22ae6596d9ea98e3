"""What is around the vehicle, and how safe is it?"""
