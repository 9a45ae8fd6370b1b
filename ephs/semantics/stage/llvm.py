"""Interface to LLVM: object code from assembly text, and addresses from object code."""

from dataclasses import dataclass, field
from functools import cache
from itertools import count
from typing import Any, Final, final

from ephs.semantics.stage.errors import StageError

LEVEL: Final = 2
"""Optimisation level of LLVM for code that is kept or shipped."""


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

    linker: Any
    linked: Any
    found: dict[str, Any] = field(default_factory=dict[str, Any])
    """What LLVM returns for a name; it unloads the code when one of these is gone."""

    def address(self, name: str) -> int:
        """Return the address of a function."""
        if name not in self.found:
            self.found[name] = self.linker.lookup(self.linked.name, name)
        return int(self.found[name][name])


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


def _machine(target: Target, level: int = LEVEL) -> Any:
    if target != host():
        _foreign()
    made = _llvm().Target.from_triple(target.triple)
    return made.create_target_machine(
        cpu=target.processor, features=target.features, opt=level, reloc="pic", codemodel="default"
    )


def compile_text(text: str, target: Target | None = None, level: int = LEVEL) -> bytes:
    """Compile assembly text to object code.

    Parameters
    ----------
    text
        A module of LLVM.
    target
        The machine to compile for; left out, this one.
    level
        Optimisation level, 0 to 3.

    Raises
    ------
    StageError
        LLVM does not accept the text.
    """
    llvm, machine = _llvm(), _machine(target or host(), level)
    try:
        module = llvm.parse_assembly(text)
        module.verify()
    except RuntimeError as error:
        raise StageError("machine", where="compile_text", found=error) from error
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    tuning = llvm.create_pipeline_tuning_options(speed_level=level)
    passes = llvm.create_pass_builder(machine, tuning)
    passes.getModulePassManager().run(module, passes)
    return bytes(machine.emit_object(module))


@cache
def _linker() -> Any:
    """Return LLVM's linker in memory: it places an object in one block, within reach of addresses of 32 bits."""
    return _llvm().create_lljit_compiler(_machine(host()), use_jit_link=True)


_COUNT: Final = count()


def load(code: bytes) -> Library:
    """Load object code for this machine."""
    linker = _linker()
    parts = _llvm().JITLibraryBuilder().add_object_img(code).add_current_process()
    return Library(linker, parts.link(linker, f"ephs{next(_COUNT)}"))
