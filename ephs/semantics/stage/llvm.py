"""Interface to LLVM: object code from assembly text, and addresses from object code."""

from dataclasses import dataclass
from functools import cache
from typing import Any, Final, final

from ephs.semantics.stage.errors import StageError

__all__ = ["LEVEL", "Library", "Target", "compile_text", "host", "load", "version"]

LEVEL: Final = 2


@final
@dataclass(frozen=True, slots=True)
class Target:
    """A machine to compile for: LLVM's triple, processor and features."""

    triple: str
    processor: str
    features: str


@final
@dataclass(frozen=True, slots=True, eq=False)
class Library:
    """Object code in memory; its addresses are good as long as this lives."""

    engine: Any

    def address(self, name: str) -> int:
        """Return the address of a function."""
        return int(self.engine.get_function_address(name))


@cache
def _llvm() -> Any:
    """Load LLVM; it has no type stubs, so only this file uses it."""
    from llvmlite import binding  # pyright: ignore[reportMissingTypeStubs]

    llvm: Any = binding
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm


@cache
def host() -> Target:
    """Return the machine that this process runs on."""
    llvm = _llvm()
    return Target(llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())


@cache
def version() -> str:
    """Return the versions of LLVM and of its binding."""
    from llvmlite import __version__  # pyright: ignore[reportMissingTypeStubs]

    return f"{'.'.join(map(str, _llvm().llvm_version_info))} {__version__}"


@cache
def _foreign() -> None:
    """Load LLVM's code for machines other than this one."""
    llvm = _llvm()
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()


def _machine(target: Target) -> Any:
    if target != host():
        _foreign()
    made = _llvm().Target.from_triple(target.triple)
    return made.create_target_machine(
        cpu=target.processor, features=target.features, opt=LEVEL, reloc="pic", codemodel="default"
    )


def compile_text(text: str, target: Target | None = None) -> bytes:
    """Compile assembly text to object code.

    Parameters
    ----------
    text
        A module of LLVM.
    target
        The machine to compile for; left out, this one.

    Raises
    ------
    StageError
        LLVM does not accept the text.
    """
    llvm, machine = _llvm(), _machine(target or host())
    try:
        module = llvm.parse_assembly(text)
        module.verify()
    except RuntimeError as error:
        raise StageError("machine", where="compile_text", found=error) from error
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    tuning = llvm.create_pipeline_tuning_options(speed_level=LEVEL)
    passes = llvm.create_pass_builder(machine, tuning)
    passes.getModulePassManager().run(module, passes)
    return bytes(machine.emit_object(module))


def load(code: bytes) -> Library:
    """Load object code for this machine."""
    llvm = _llvm()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine(host()))
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return Library(engine)
