"""One module per sub-command: `add_arguments(parser)` declares its options, `run(args) -> int` does it.

The module of a sub-command whose name is a Python keyword ends in an underscore (`import` is `import_.py`).
Modules are imported only when their sub-command is called, so `--help` stays fast and loads no Mitsuba.
"""
