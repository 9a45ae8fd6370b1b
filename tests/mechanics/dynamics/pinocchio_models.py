"""Trees of joints as models of Pinocchio: its joint frames are C2, its 6-vectors (linear, angular)."""

import numpy as np
import pinocchio as pin

from ephs.mechanics.scene.model import GROUND
from ephs.semantics.spaces import SE3
from ephs.semantics.spaces.rotations import quaternion_to_matrix

KINDS = {
    "revolute": pin.JointModelRZ,
    "prismatic": pin.JointModelPZ,
    "spherical": pin.JointModelSpherical,
    "free": pin.JointModelFreeFlyer,
}
SWAP = np.array([3, 4, 5, 0, 1, 2])
"""(angular, linear) from (linear, angular), and back."""


def placement(pose):
    return pin.SE3(quaternion_to_matrix(pose[:4]), np.array(pose[4:]))


class PinModel:
    """A scene's tree as Pinocchio has it; ``order`` takes its vectors to those of the dynamics."""

    def __init__(self, scene, dynamics):
        self.model = pin.Model()
        self.model.gravity.linear = np.array(scene.world.gravity)
        self.joint, self.frame, self.names = {GROUND: 0}, {GROUND: SE3.identity()}, []
        self.scene = scene
        places = []
        joints = [j for _, j in scene.all_joints()] + [j for _, j in scene.implicit_joints()]
        branches = [GROUND]  # depth first: Pinocchio wants each subtree's freedoms in one row
        while branches:
            j = next((j for j in joints if j.body1 == branches[-1]), None)
            if j is None:
                branches.pop()
                continue
            joints.remove(j)
            branches.append(j.body2)
            before = SE3.compose(SE3.inverse(self.frame[j.body1]), j.frame1)
            new = self.model.addJoint(self.joint[j.body1], KINDS[j.kind](), placement(before), j.name)
            self.joint[j.body2], self.frame[j.body2] = new, np.array(j.frame2)
            body = scene.body(j.body2)
            inertia = pin.Inertia(body.mass, np.zeros(3), np.array(body.inertia))
            self.model.appendBodyToJoint(new, inertia, placement(SE3.inverse(j.frame2)))
            where = dynamics.freedoms[j.name]
            places.append(where[SWAP] if j.kind == "free" else where)
            self.names.append(j)
        self.order = np.concatenate(places)
        self.data = self.model.createData()

    def configuration(self, dynamics, state):
        """Pinocchio's q: quaternions scalar last, positions before them."""
        out = []
        for j in self.names:
            x = state.array[dynamics.layout.elements[j.name]]
            turn = np.append(x[1:4], x[0]) if j.kind in ("spherical", "free") else x
            out.append(np.concatenate([x[4:7], turn]) if j.kind == "free" else turn)
        return np.concatenate(out)

    def vector(self, values):
        """A vector of the dynamics as Pinocchio has it."""
        return values[self.order]

    def back(self, values):
        """A vector of Pinocchio as the dynamics have it."""
        out = np.empty_like(values)
        out[self.order] = values
        return out

    def matrix(self, values):
        """A matrix of Pinocchio as the dynamics have it."""
        out = np.empty_like(values)
        out[np.ix_(self.order, self.order)] = values
        return out

    def body_jacobian(self, name, q):
        """(6, n) to a body's twist in its own frame."""
        pin.computeJointJacobians(self.model, self.data, q)
        there = pin.getJointJacobian(self.model, self.data, self.joint[name], pin.LOCAL).reshape(6, -1)
        here = placement(self.frame[name]).action @ there  # from C2 to the body
        out = np.empty_like(here)
        out[:, self.order] = here[SWAP]
        return out
