"""Other programs on the scenes of this package, where they are installed: Pinocchio and MuJoCo.

`scene` writes a scene as the tree of joints that both know, `pinocchio` and `mujoco` run it, `programs` lists their
integrators, `measure` puts their errors and times beside those of the methods of this package.
"""
