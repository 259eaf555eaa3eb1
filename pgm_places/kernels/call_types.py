"""Types of calls in kernels: each is found once while kernels are compiled, not at every call.

Numba asks dozens of templates what each ``+``, ``<`` or ``a[i]`` of a kernel takes and returns, and
writes down why each of them does not fit. Nine of ten calls are of an operator on types that it
has been asked for before. This took a fifth of the processor time of compiling.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.compiler_lock import global_compiler_lock
from numba.core.types.functions import BaseFunction

__all__ = ["remembered"]

_known: dict[tuple[Any, Any], tuple[Any, Any]] = {}
"""The function itself and the signature found, by function and types of arguments."""

_NOTHING: tuple[Any, Any] = None, None


@contextmanager
def remembered() -> Iterator[None]:
    """While the block lasts, what builtin functions take and return is looked up once.

    Overloads written in Python are asked every time, as they are compiled for the flags of their
    caller. Numba is left as it was: nobody else compiles meanwhile, and what users compile
    themselves is typed by numba alone.
    """
    functions: Any = BaseFunction
    with global_compiler_lock:
        original = functions.get_call_type

        def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
            known, signature = _known.get((self, args), _NOTHING)
            if known is self and not kws:
                self._impl_keys[signature.args] = self.typing_key  # as numba does at every call
                return signature
            signature = original(self, context, args, kws)
            is_builtin = self._impl_keys.get(signature.args) is self.typing_key
            if is_builtin and not kws:
                _known[self, args] = self, signature
            return signature

        functions.get_call_type = get_call_type
        try:
            yield
        finally:
            functions.get_call_type = original
