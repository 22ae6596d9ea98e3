"""The process around the navigator: sockets, clock, log."""
