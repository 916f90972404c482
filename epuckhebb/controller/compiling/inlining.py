"""How numba compiles a function that is only ever inlined into a kernel: without machine code of its own.

Numba prepares every function to be called by itself, from Python and from C. A building block needs only the
intermediate code, which LLVM puts into the kernel that calls it; the rest took a quarter of the compile time of the
paper's kernel (numba 0.68: 9.0 CPU s with it, 6.8 without). Results do not depend on it (`tests/test_digest.py`).
"""

from typing import Any

from numba import _dynfunc
from numba import config as settings
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import NativeLowering


class _IntermediateCode(JITCodeLibrary):
    """The code of a function, to be linked into that of others."""

    def _optimize_functions(self, ll_module: Any) -> None:
        """Leave this to the module's own optimisation, which follows; doing both makes no step faster, and takes 10 %.

        That one is worth its time: without it a step takes 4 % longer.
        """
        ll_module.data_layout = self._codegen._data_layout

    def _finalize_final_module(self) -> None:
        """Leave the code as it is; numba would translate it for the processor and load it."""
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _LoweringToInline(NativeLowering):
    """Numba's step from typed code to LLVM's, for a function that nobody calls by its address."""

    _name = "lowering_to_inline"

    def run_pass(self, state: Any) -> bool:
        """Lower a function to LLVM's code, without loading it.

        Numba finds the code of a function by the Python object that calls it. The one made here has the address 0: all
        calls are inlined, so it is never called.
        """
        state.library = _IntermediateCode(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags = state.flags.copy()
        state.flags.no_compile = state.flags.no_cpython_wrapper = state.flags.no_cfunc_wrapper = True
        super().run_pass(state)
        lowered = state["cr"]
        kept_alive = (state.library,)
        placeholder = _dynfunc.make_function(
            lowered.fndesc.lookup_module(), state.func_id.func_name, "", 0, lowered.env, kept_alive
        )
        state.targetctx.insert_user_function(placeholder, lowered.fndesc, [state.library])
        state["cr"] = lowered._replace(cfunc=placeholder)
        return True


class InlinedCompiler(CompilerBase):
    """Numba's compiler (its `pipeline_class`) for functions that are inlined."""

    def define_pipelines(self) -> list[PassManager]:
        """Numba's own steps, but for the last."""
        steps = DefaultPassBuilder.define_nopython_pipeline(self.state)
        steps.passes = [(_LoweringToInline if step is NativeLowering else step, text) for step, text in steps.passes]
        steps.finalize()
        return [steps]


class CheckedCompiler(Compiler):
    """Numba's compiler for functions of the user's: they, and all that they call, check the bounds of arrays."""

    def compile_extra(self, func: Any) -> Any:
        """Compile with the setting that NUMBA_BOUNDSCHECK has; the option `boundscheck` leaves out what is called."""
        previous, settings.BOUNDSCHECK = settings.BOUNDSCHECK, 1
        try:
            return super().compile_extra(func)
        finally:
            settings.BOUNDSCHECK = previous
