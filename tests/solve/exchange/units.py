"""Units for tests: a spring of FMI 2.0 in C, and changed copies of any unit."""

import platform
from pathlib import Path
from zipfile import ZipFile

from fmpy import platform_tuple, sharedLibraryExtension

from ephs.exporting.linking import tool

SOURCE = Path(__file__).with_name("spring.c")
FOLDER = {"Linux": "linux64", "Darwin": "darwin64", "Windows": "win64"}[platform.system()]
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="spring" guid="{spring}">
  <CoSimulation modelIdentifier="spring" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"
    canSerializeFMUstate="true"/>
  <UnitDefinitions>
    <Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>
    <Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit>
    <Unit name="N.s"><BaseUnit kg="1" m="1" s="-1"/></Unit>
    <Unit name="mm/s"><BaseUnit m="1" s="-1" factor="0.001"/></Unit>
  </UnitDefinitions>
  <ModelVariables>
    <ScalarVariable name="speed" valueReference="0" causality="input" variability="continuous">
      <Real start="0" unit="m/s"/></ScalarVariable>
    <ScalarVariable name="force" valueReference="1" causality="output" variability="continuous">
      <Real unit="N"/></ScalarVariable>
    <ScalarVariable name="impulse" valueReference="2" causality="output" variability="continuous">
      <Real unit="N.s"/></ScalarVariable>
    <ScalarVariable name="stiffness" valueReference="3" causality="parameter" variability="fixed">
      <Real start="100"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="2" dependencies=""/><Unknown index="3" dependencies=""/></Outputs>
    <InitialUnknowns><Unknown index="2"/><Unknown index="3"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""


def spring(folder):
    """The spring as a unit of this machine."""
    library = folder / f"spring{sharedLibraryExtension}"
    tool("a test", "cc", "-shared", "-fPIC", "-O1", "-w", SOURCE, "-o", library)
    file = folder / "spring.fmu"
    with ZipFile(file, "w") as unit:
        unit.writestr("modelDescription.xml", DESCRIPTION)
        unit.write(library, f"binaries/{FOLDER}/spring{sharedLibraryExtension}")
    return file


def changed(file, folder, **replaced):
    """A copy of a unit in whose description each of some texts, which must be there, is another."""
    copy = folder / "changed.fmu"
    with ZipFile(file) as old, ZipFile(copy, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                for before, after in replaced.pop("texts").items():
                    assert before.encode() in content, before
                    content = content.replace(before.encode(), after.encode())
            new.writestr(name, content)
    return copy


__all__ = ["changed", "platform_tuple", "spring"]
