"""Small models in each format, written for these tests."""

URDF = """<?xml version="1.0"?>
<robot name="arm">
  <link name="hand.tip"/>
  <link name="base">
    <inertial><origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/><mass value="3"/>
      <inertia ixx="0.3" ixy="0.01" ixz="-0.02" iyy="0.25" iyz="0.03" izz="0.2"/></inertial>
    <visual><origin xyz="0 0 0.1" rpy="0 0 0.5"/><geometry><box size="0.1 0.2 0.3"/></geometry></visual>
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <link name="turn">
    <inertial><origin xyz="0 0 0.3" rpy="1 0.5 0"/><mass value="1"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.12" iyz="0" izz="0.05"/></inertial>
    <visual><geometry><cylinder radius="0.05" length="0.4"/></geometry></visual>
  </link>
  <link name="spin">
    <inertial><origin xyz="0.2 0 0"/><mass value="0.7"/>
      <inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.04"/></inertial>
  </link>
  <link name="slide">
    <inertial><origin xyz="0 0.1 0"/><mass value="0.5"/>
      <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0.002" izz="0.03"/></inertial>
  </link>
  <link name="plate">
    <inertial><origin xyz="0 0.1 0.2"/><mass value="0.4"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.015" iyz="0.002" izz="0.02"/></inertial>
  </link>
  <link name="loose">
    <inertial><origin xyz="0.1 0.1 0"/><mass value="0.6"/>
      <inertia ixx="0.03" ixy="0" ixz="0.001" iyy="0.02" iyz="0" izz="0.025"/></inertial>
  </link>
  <joint name="mount" type="fixed"><parent link="slide"/><child link="hand.tip"/><origin xyz="0 0 1"/></joint>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="turn"/>
    <origin xyz="0.1 0 0.4" rpy="0.3 -0.2 0.7"/><axis xyz="0.2 1 0.3"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/><dynamics damping="0.3" friction="0.1"/></joint>
  <joint name="elbow.pitch" type="continuous"><parent link="turn"/><child link="spin"/>
    <origin xyz="0 0 0.6"/><axis xyz="0 1 0"/></joint>
  <joint name="rail" type="prismatic"><parent link="spin"/><child link="slide"/>
    <origin xyz="0.4 0 0" rpy="0 0.4 0"/><axis xyz="1 0 2"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="table" type="planar"><parent link="base"/><child link="plate"/>
    <origin xyz="0 1 0" rpy="0.7 0.2 0.1"/><axis xyz="0 0 1"/></joint>
  <joint name="drone" type="floating"><parent link="turn"/><child link="loose"/>
    <origin xyz="0 0 1" rpy="0 0.3 0"/></joint>
  <transmission name="motor"/>
</robot>
"""

# A parallelogram in the x–z plane, crank and rocker 0.3 m, coupler 0.8 m; the rocker meets the coupler in a ball. The
# same in SDF, with every way to say where a frame is, and in MJCF.
SDF = """<?xml version="1.0"?>
<sdf version="1.7"><world name="w"><gravity>0 0.5 -9</gravity>
<model name="four-bar">
  <pose>0 0 1 0 0 0</pose>
  <frame name="top"><pose>0 0 0.3 0 0 0</pose></frame>
  <link name="crank"><pose>0 0 0.15 0 0 0.2</pose><inertial><mass>0.2</mass>
    <inertia><ixx>2e-3</ixx><iyy>3e-3</iyy><izz>1.5e-3</izz></inertia></inertial></link>
  <link name="coupler"><pose relative_to="top">0.4 0 0 0 0 0</pose>
    <inertial><pose>0 0 0.01 0 0 90</pose><mass>0.5</mass>
    <inertia><ixx>0.02</ixx><iyy>0.02</iyy><izz>0.03</izz></inertia></inertial>
    <visual name="v"><geometry><box><size>0.8 0.02 0.02</size></box></geometry></visual></link>
  <link name="rocker"><pose degrees="true">0.8 0 0.15 0 90 0</pose><inertial><mass>0.3</mass>
    <inertia><ixx>3e-3</ixx><iyy>4e-3</iyy><izz>2e-3</izz></inertia></inertial>
    <collision name="c"><geometry><sphere><radius>0.1</radius></sphere></geometry></collision></link>
  <joint name="motor" type="revolute"><parent>world</parent><child>crank</child><pose>0 0 -0.15 0 0 0</pose>
    <axis><xyz expressed_in="__model__">0 1 0</xyz><limit><lower>-1</lower><upper>1</upper></limit>
      <dynamics><damping>0.02</damping><friction>0.01</friction></dynamics></axis></joint>
  <joint name="knee" type="continuous"><parent>crank</parent><child>coupler</child><pose relative_to="top"/>
    <axis><xyz>0 1 0</xyz></axis></joint>
  <joint name="foot" type="revolute"><parent>world</parent><child>rocker</child><pose>0.15 0 0 0 0 0</pose>
    <axis><xyz>0 1 0</xyz><dynamics><spring_stiffness>2</spring_stiffness><spring_reference>0.4</spring_reference>
    </dynamics></axis></joint>
  <joint name="ball" type="ball"><parent>coupler</parent><child>rocker</child><pose>-0.15 0 0 0 0 0</pose></joint>
  <plugin name="controller" filename="libnone.so"/>
</model></world></sdf>
"""
MJCF = """
<mujoco model="four-bar">
  <compiler angle="radian" autolimits="true"/>
  <option gravity="0 0.5 -9"/>
  <worldbody>
    <body name="crank" pos="0 0 1">
      <joint name="motor" axis="0 1 0" damping="0.02" frictionloss="0.01" range="-1 1"/>
      <inertial pos="0 0 0.15" quat="0.995004165278 0 0 0.0998334166468" mass="0.2" diaginertia="2e-3 3e-3 1.5e-3"/>
      <body name="coupler" pos="0 0 0.3">
        <joint name="knee" axis="0 1 0"/>
        <inertial pos="0.4 0 0.01" mass="0.5" diaginertia="0.02 0.02 0.03"/>
        <geom type="box" size="0.4 0.01 0.01" pos="0.4 0 0"/>
      </body>
    </body>
    <body name="rocker" pos="0.8 0 1">
      <joint name="foot" axis="0 1 0" stiffness="2" springref="0.4"/>
      <inertial pos="0 0 0.15" mass="0.3" diaginertia="2e-3 4e-3 3e-3"/>
    </body>
  </worldbody>
  <equality><connect name="ball" body1="coupler" body2="rocker" anchor="0.8 0 0"/></equality>
  <actuator><motor name="drive" joint="motor"/></actuator>
  <sensor><jointpos name="angle" joint="motor"/></sensor>
</mujoco>
"""
MODELS = {"urdf": URDF, "sdf": SDF, "xml": MJCF}
