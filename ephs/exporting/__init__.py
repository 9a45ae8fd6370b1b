"""Mechanisms as programs without Python: object code, C text, WebAssembly, FMI units, and pages that simulate."""
