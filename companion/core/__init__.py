"""The ground floor: values, frames, geometry, map, parameters, MAVLink codec, transports."""
