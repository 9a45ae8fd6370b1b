"""From a flat system to tables of links, joints, forces and heat: by structure alone."""
