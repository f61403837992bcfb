"""The URDF of an arm of five joints, with a hand that is fixed to it and a finger that slides."""

NAMES = ("j1", "j2", "j3", "j4", "j5")
BALL = '<collision><geometry><sphere radius="{}"/></geometry></collision>'
BOX = '<collision><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.08 0.08"/></geometry></collision>'


def link(name, mass, shape=""):
    return (
        f'<link name="{name}"><inertial><origin xyz="0.1 0 0.02" rpy="0.3 0 0.2"/><mass value="{mass}"/>'
        f'<inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0.001" ixz="0" iyz="0"/></inertial>{shape}</link>'
    )


def joint(name, kind, parent, child, xyz, rpy="0 0 0", limit='lower="-2" upper="2.5" velocity="2" effort="80"'):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="0 0 1"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><limit {limit}/><dynamics damping="0.5" friction="1.5"/></joint>'
    )


URDF = "".join(
    [
        '<robot name="five">',
        link("base", 9, BALL.format(0.1)),
        link("l1", 5, BALL.format(0.08)),
        link("l2", 4, BOX),
        link("l3", 3, BOX),
        link("l4", 1, BALL.format(0.05)),
        link("l5", 0.5),
        link("hand", 0.7, BALL.format(0.04)),
        link("finger", 0.1),
        joint("j1", "revolute", "base", "l1", "0 0 0.25"),
        joint("j2", "revolute", "l1", "l2", "0 0.1 0", "1.5708 0 0"),
        joint("j3", "revolute", "l2", "l3", "0.4 0 0"),
        joint("j4", "revolute", "l3", "l4", "0.42 0 0", "0 1.5708 0"),
        joint("j5", "revolute", "l4", "l5", "0 0 0.1"),
        joint("wrist", "fixed", "l5", "hand", "0 0 0.06", "0 0.4 0"),
        joint("squeeze", "prismatic", "hand", "finger", "0 0 0.05"),
        "</robot>",
    ]
)
