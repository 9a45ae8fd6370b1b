package Parts "Components by their textbook equations, in the units and connectors that Modelica's libraries have"
  connector Pin
    Real v(unit = "V");
    flow Real i(unit = "A");
  end Pin;
  connector Flange
    Real phi(unit = "rad");
    flow Real tau(unit = "N.m");
  end Flange;
  connector Slide
    Real s(unit = "m");
    flow Real f(unit = "N");
  end Slide;
  connector Heat
    Real T(unit = "K", start = 300);
    flow Real Q_flow(unit = "W");
  end Heat;

  partial model Pins
    Pin p;
    Pin n;
  end Pins;
  partial model Branch
    Pin p;
    Pin n;
    Real v(unit = "V");
    Real i(unit = "A");
  equation
    v = p.v - n.v;
    i = p.i;
    p.i + n.i = 0;
  end Branch;
  partial model Pairs "Two branches"
    Pin p;
    Pin n;
    Pin p2;
    Pin n2;
    Real v(unit = "V");
    Real v2(unit = "V");
    Real i(unit = "A");
    Real i2(unit = "A");
  equation
    v = p.v - n.v;
    v2 = p2.v - n2.v;
    i = p.i;
    i2 = p2.i;
    p.i + n.i = 0;
    p2.i + n2.i = 0;
  end Pairs;
  partial model Shafts
    Flange a;
    Flange b;
  end Shafts;
  partial model Conduction
    Heat a;
    Heat b;
    Real Q(unit = "W");
  equation
    a.Q_flow = Q;
    b.Q_flow = -Q;
  end Conduction;

  model Ground
    Pin p;
  equation
    p.v = 0;
  end Ground;
  model Resistor
    extends Branch;
    parameter Real R(unit = "Ohm") = 2;
    parameter Real alpha(unit = "1/K") = 0;
    Heat heat;
    Real actual(unit = "Ohm");
    Real loss(unit = "W");
  equation
    actual = R*(1 + alpha*(heat.T - 300));
    v = actual*i;
    loss = v*i;
    heat.Q_flow = -loss;
  end Resistor;
  model Capacitor
    extends Branch(v(start = 3));
    parameter Real C(unit = "F") = 0.5;
  equation
    i = C*der(v);
  end Capacitor;
  model Charged
    extends Branch(v(start = 2*v0 - v1));
    parameter Real v0 = 1;
    parameter Real v1 = 0;
    parameter Real C(unit = "F") = 0.5;
  equation
    i = C*der(v);
  end Charged;
  model Initial
    extends Branch(v(start = 7));
    parameter Real v0 = 1;
    parameter Real v1 = 0;
    parameter Real C(unit = "F") = 0.5;
  initial equation
    C*v = v0 - C*v1;
  equation
    i = C*der(v);
  end Initial;
  model Warm
    Heat port;
    parameter Real v0 = 1;
    parameter Real v1 = 0;
    Real rise(unit = "K", start = 5);
    Real T(unit = "K", start = 2*v0 - v1);
  equation
    rise = T - 300;
    T = port.T;
    20*der(T) = port.Q_flow;
  end Warm;
  model Settled
    extends Branch;
  initial equation
    der(v) = 0;
  equation
    i = der(v);
  end Settled;
  model Inductor
    extends Branch;
    parameter Real L(unit = "H") = 0.25;
  equation
    L*der(i) = v;
  end Inductor;
  model Coils
    extends Pairs;
    parameter Real L = 2;
    parameter Real L2 = 3;
    parameter Real M = 1;
  equation
    v = L*der(i) + M*der(i2);
    v2 = M*der(i) + L2*der(i2);
  end Coils;
  model Gyrator
    extends Pairs;
    parameter Real G = 2;
    parameter Real G2 = G;
  equation
    i = G*v2;
    i2 = -G2*v;
  end Gyrator;
  model Transformer
    extends Pairs;
    parameter Real n_turns = 4;
  equation
    v = n_turns*v2;
    i2 = -n_turns*i;
  end Transformer;
  model Machine "Magnet and coil, without its circuit"
    extends Branch;
    Flange a;
    parameter Real k(unit = "V.s") = 0.3;
    Real w(unit = "rad/s");
  equation
    w = der(a.phi);
    v = k*w;
    a.tau = -k*i;
  end Machine;
  model Inertia
    extends Shafts;
    parameter Real J = 0.7;
    Real phi(unit = "rad");
    Real w(unit = "rad/s", start = 1);
    Real acceleration(unit = "rad/s2");
  equation
    phi = a.phi;
    phi = b.phi;
    w = der(phi);
    acceleration = der(w);
    J*acceleration = a.tau + b.tau;
  end Inertia;
  model Spring
    extends Shafts;
    parameter Real c = 5;
    parameter Real rest(unit = "rad") = 0.1;
    parameter Real d = 0;
    Real twist(unit = "rad", start = 0.4);
  equation
    twist = b.phi - a.phi;
    b.tau = c*(twist - rest) + d*der(twist);
    a.tau = -b.tau;
  end Spring;
  model Gear
    extends Shafts;
    parameter Real ratio = 3;
  equation
    a.phi = ratio*b.phi;
    ratio*a.tau + b.tau = 0;
  end Gear;
  model Rack
    Flange a;
    Slide slide;
    parameter Real radius(unit = "m") = 0.2;
  equation
    slide.s = radius*a.phi;
    a.tau + radius*slide.f = 0;
  end Rack;
  model Differential
    extends Shafts;
    Flange cage;
  equation
    a.phi + b.phi = 2*cage.phi;
    a.tau = b.tau;
    cage.tau = -2*a.tau;
  end Differential;
  model Voltmeter
    extends Branch;
    output Real reading(unit = "V");
  equation
    i = 0;
    reading = v;
  end Voltmeter;
  connector RealOutput = output Real;
  model Ammeter
    extends Pins;
    RealOutput i;
  equation
    p.v = n.v;
    p.i = i;
    n.i = -i;
  end Ammeter;
  model Capacity
    Heat port;
    parameter Real C = 20;
    Real T(unit = "K", start = 320);
  equation
    T = port.T;
    C*der(T) = port.Q_flow;
  end Capacity;
  model Conductor
    extends Conduction;
    parameter Real G = 4;
  equation
    Q = G*(a.T - b.T);
  end Conductor;
  model Radiation
    extends Conduction;
    parameter Real area = 1;
  equation
    Q = 5.67e-8*area*(a.T^4 - b.T^4);
  end Radiation;

  model Thermometer
    Heat port;
    output Real T(unit = "K");
  equation
    port.Q_flow = 0;
    T = port.T;
  end Thermometer;
  model Contact "Three bodies of one temperature"
    Heat a;
    Heat b;
    Heat c;
  equation
    a.T = b.T;
    b.T = c.T;
    a.Q_flow + b.Q_flow + c.Q_flow = 0;
  end Contact;

  model Thermostat
    Heat port;
  equation
    port.T = 300;
  end Thermostat;
  model Heater
    Heat port;
  equation
    port.Q_flow = -50;
  end Heater;
  model Sampler
    extends Branch;
  equation
    when v > 0 then
      i = 1;
    end when;
  end Sampler;
  model Amplifier
    extends Pairs;
    parameter Real gain = 10;
  equation
    i = 0;
    v2 = gain*v;
  end Amplifier;
  model Battery
    extends Branch;
    parameter Real V(unit = "V") = 12;
  equation
    v = V;
  end Battery;
  model Cold "Takes energy, and gives no heat"
    extends Branch;
    Heat heat;
  equation
    v = 2*i;
    heat.Q_flow = 0;
  end Cold;
  model Pump
    extends Conduction;
  equation
    Q = 3*(b.T - a.T);
  end Pump;
  model Fountain
    Heat a;
    Heat b;
  equation
    a.Q_flow = a.T - b.T;
    b.Q_flow = a.T - b.T;
  end Fountain;
  model Diode
    extends Branch;
  equation
    i = if v > 0 then v else 0;
  end Diode;
  model Lamp
    extends Branch;
  equation
    v = i^3;
  end Lamp;
  model Rheostat
    extends Branch;
    input Real R(unit = "Ohm");
  equation
    v = R*i;
  end Rheostat;
  model Loose
    extends Branch;
  end Loose;
  model Delayed "A capacitor behind a resistor, in one"
    extends Branch;
    Real u(unit = "V");
  equation
    i = v - u;
    der(u) = i;
  end Delayed;
  model Negative
    extends Capacitor(C = -1);
  end Negative;
  model Bare
    Real x;
  equation
    der(x) = -x;
  end Bare;
  model Many
    Pin p[3];
  equation
    p[1].i = 0;
    p[2].i = 0;
    p[3].i = 0;
  end Many;
  model Clock
    extends Branch;
  equation
    v = sin(time)*i;
  end Clock;
  model Stepwise
    extends Branch;
    Real y;
  algorithm
    y := v;
  end Stepwise;
  model Assigned
    extends Capacitor;
  initial algorithm
    v := 5;
  end Assigned;
  model Alias "Starts at 3 V, by the name that is no state"
    extends Branch(v(start = 3, fixed = true));
    Real u(unit = "V");
  equation
    u = v;
    i = der(u);
  end Alias;
  model Placed
    extends Inertia(phi(start = 1, fixed = true));
  end Placed;
  model Standing "Where all is that nobody places"
    extends Inertia(phi(start = 0, fixed = true), w(start = 1, fixed = true));
  end Standing;
  model Risen
    extends Warm(rise(fixed = true));
  end Risen;
  function exp
    input Real x;
    output Real y;
  algorithm
    y := 2*x;
  end exp;
  model Doubled
    extends Branch;
  equation
    v = exp(1)*i;
  end Doubled;
  model Unsaid
    extends Branch;
    parameter Real R;
  equation
    v = R*i;
  end Unsaid;
  connector Vane
    Real s(unit = "m");
    flow Real tau(unit = "N.m");
  end Vane;
  model Reversed "A connector of length and torque"
    Vane p;
  equation
    p.s = 0;
  end Reversed;
end Parts;
