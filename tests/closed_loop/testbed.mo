// The testbed in Modelica, which replaces the class that OpenModelica makes from the FMU. It has the equations of each part, not the
// combined eqs. (8) to (11).
model prw_testbed_me_FMU
  constant Real per_degree = 57.29577951308232;
  parameter Real J2 = 3.8681291e-3, J3 = 1.2750004e-2, H3 = 4.2363841e-2;
  parameter Real k1 = 2.11 * per_degree, k2 = 0.76 * per_degree;
  parameter Real c1 = 7.83e-3 * per_degree, c2 = 8.35e-3 * per_degree, c3 = 6.66e-3 * per_degree;
  parameter Real ratio = 7 / (2 * 4) "N / 2M";
  input Real theta1, theta2, omega1, omega2;
  output Real tau1, tau2, pitch, roll;
  Real theta3(start = 0, fixed = true), theta4(start = 0, fixed = true);
  Real theta5(start = 0, fixed = true), theta6(start = 0, fixed = true);
  Real omega5(start = 0, fixed = true), omega6(start = 0, fixed = true);
  Real pitching, rolling "Torques of pitch and roll on the cam shaft";
equation
  tau1 = -(k1 * (theta1 - theta3) + c1 * (omega1 - der(theta3)));
  tau2 = -(k1 * (theta2 - theta4) + c1 * (omega2 - der(theta4)));
  // The shafts between the couplings have no inertia, so both couplings of a side transmit the same torque.
  -tau1 = k2 * (theta3 - theta5) + c2 * (der(theta3) - omega5);
  -tau2 = k2 * (theta4 - theta6) + c2 * (der(theta4) - omega6);
  der(theta5) = omega5;
  der(theta6) = omega6;
  pitch = (theta5 + theta6) / 2;
  roll = ratio * (theta5 - theta6);
  pitching = H3 * (der(omega5) + der(omega6)) / 2 + c3 * (omega5 + omega6) / 2;
  rolling = J3 * ratio * (der(omega5) - der(omega6)) + c3 * ratio * (omega5 - omega6);
  // By the balance of power, a carrier takes half of the pitching torque, plus or minus `ratio` times the rolling torque.
  J2 * der(omega5) = -tau1 - pitching / 2 - ratio * rolling;
  J2 * der(omega6) = -tau2 - pitching / 2 + ratio * rolling;
end prw_testbed_me_FMU;
