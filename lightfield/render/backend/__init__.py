"""What Mitsuba computes on: the choice between CUDA and LLVM, and the search for a usable libLLVM."""

from lightfield.render.backend.choice import (
    THREADS_VARIABLE,
    choose,
    limited_threads,
    prepare,
    use_backend,
    with_plugins,
)

__all__ = ["THREADS_VARIABLE", "choose", "limited_threads", "prepare", "use_backend", "with_plugins"]
