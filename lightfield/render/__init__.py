"""Light transport in Mitsuba 3: backend, plugins, tracer, transport response."""
