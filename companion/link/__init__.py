"""What does the vehicle say? Messages in, one tick's inputs out."""
