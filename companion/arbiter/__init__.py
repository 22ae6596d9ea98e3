"""Who flies: Travel, RL or Landing? Depends on nothing learned."""
