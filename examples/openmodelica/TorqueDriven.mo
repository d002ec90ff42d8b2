// The testbed with motors that have inertia: both motors get a torque, and the wrist pushes back on them. torque_driven.mos imports
// the FMU and simulates `Machine` and `MachineOfLibrary`, which are the same machine in two notations.
//
// tau1 and tau2 of the testbed are the torques that the wrist exerts on its motors (eq. (9) of the paper), so they are added to the
// torque of the motor. With the opposite sign the machine is unstable.
//
// Model Exchange needs neither `pre` nor a sample here, because a motor with inertia passes no torque through at the same instant:
// tau1 changes the acceleration of the motor, and only its integral returns to the FMU. The loop is therefore not algebraic.

package TorqueDriven "The pitch-roll wrist, driven by two motors with inertia, friction and current control"

  record Motor "Assumed motor with gear, seen from the output of the gear. The paper gives no motor data"
    parameter Real J1(unit = "kg.m2") = 2e-3 "Inertia of the motor, J1 of the paper";
    parameter Real friction(unit = "N.m") = 0.05 "Dry friction";
    parameter Real creep(unit = "rad/s") = 0.02 "Rate at which the dry friction has reached 76 %";
    parameter Real damping(unit = "N.m.s/rad") = 2e-3 "Viscous friction";
    parameter Real R(unit = "Ohm") = 1 "Resistance";
    parameter Real L(unit = "H") = 2e-3 "Inductance";
    parameter Real k(unit = "N.m/A") = 0.5 "Torque constant, and constant of the back electromotive force in V.s/rad";
  end Motor;

  record Gains "Gains of both control loops"
    parameter Real stiffness(unit = "N.m/rad") = 40 "Angle loop: torque per angle error";
    parameter Real damping(unit = "N.m.s/rad") = 0.6 "Angle loop: torque per rate error";
    parameter Real proportional(unit = "V/A") = 2 "Current loop";
    parameter Real integral(unit = "V/(A.s)") = 1000 "Current loop";
  end Gains;

  model Move "Motor angles that take the wrist from rest to a pitch and a roll angle, by the inverse of eq. (1)"
    parameter Real pitch(unit = "rad") = 0.5235987755982988 "Pitch at the end, 30 degrees";
    parameter Real roll(unit = "rad") = 1.0471975511965976 "Roll at the end, 60 degrees";
    parameter Real duration(unit = "s") = 0.6 "Duration of the move";
    parameter Real M = 4 "Lobes of the cams";
    parameter Real N = 7 "Rollers";
    Real way "0 at the start, 1 at the end";
    Real slope(unit = "1/s") "Its derivative";
    output Real theta[2](each unit = "rad") "Angles of both motors";
    output Real omega[2](each unit = "rad/s") "Their rates";
  protected
    constant Real pi = 3.141592653589793;
  equation
    way = if time < duration then (1 - cos(pi * time / duration)) / 2 else 1;
    slope = if time < duration then pi / (2 * duration) * sin(pi * time / duration) else 0;
    theta[1] = (pitch + M / N * roll) * way;
    theta[2] = (pitch - M / N * roll) * way;
    omega[1] = (pitch + M / N * roll) * slope;
    omega[2] = (pitch - M / N * roll) * slope;
  end Move;

  model Drive "A motor with its current loop and its angle loop"
    parameter Motor motor;
    parameter Gains gains;
    input Real theta_ref(unit = "rad") "Angle that the motor should have";
    input Real omega_ref(unit = "rad/s") "Its rate";
    input Real tau(unit = "N.m") "Torque of the wrist on the motor: tau1 or tau2 of the testbed";
    output Real theta(unit = "rad", start = 0, fixed = true) "Angle";
    output Real omega(unit = "rad/s", start = 0, fixed = true) "Rate";
    output Real torque(unit = "N.m") "Torque of the motor";
    Real current(unit = "A", start = 0, fixed = true);
    Real current_ref(unit = "A") "Current that the angle loop asks for";
    Real integral(unit = "V", start = 0, fixed = true) "Integral part of the current loop";
    Real voltage(unit = "V");
  equation
    current_ref = (gains.stiffness * (theta_ref - theta) + gains.damping * (omega_ref - omega)) / motor.k;
    der(integral) = gains.integral * (current_ref - current);
    voltage = gains.proportional * (current_ref - current) + integral;
    motor.L * der(current) = voltage - motor.R * current - motor.k * omega;
    torque = motor.k * current;
    der(theta) = omega;
    // tau is added: it is negative while the motor drives the wrist.
    motor.J1 * der(omega) = torque - motor.damping * omega - motor.friction * tanh(omega / motor.creep) + tau;
  end Drive;

  model Machine "Two drives and the wrist, in plain Modelica"
    prw_testbed_me_FMU testbed;
    Move move;
    Drive drive1;
    Drive drive2;
  equation
    drive1.theta_ref = move.theta[1];
    drive1.omega_ref = move.omega[1];
    drive2.theta_ref = move.theta[2];
    drive2.omega_ref = move.omega[2];
    testbed.theta1 = drive1.theta;
    testbed.omega1 = drive1.omega;
    testbed.theta2 = drive2.theta;
    testbed.omega2 = drive2.omega;
    drive1.tau = testbed.tau1;
    drive2.tau = testbed.tau2;
  end Machine;

  model DriveOfLibrary "The same drive from components of the Modelica library"
    parameter Motor motor;
    parameter Gains gains;
    input Real theta_ref(unit = "rad") "Angle that the motor should have";
    input Real omega_ref(unit = "rad/s") "Its rate";
    Modelica.Blocks.Interfaces.RealInput tau(unit = "N.m") "Torque of the wrist on the motor: tau1 or tau2 of the testbed";
    Modelica.Blocks.Interfaces.RealOutput theta(unit = "rad") "Angle";
    Modelica.Blocks.Interfaces.RealOutput omega(unit = "rad/s") "Rate";
    Modelica.Mechanics.Rotational.Components.Inertia rotor(J = motor.J1, phi(fixed = true), w(fixed = true));
    Modelica.Mechanics.Rotational.Components.Damper bearing(d = motor.damping);
    // 2 / (1 + exp(-w / (0.01 w0))) - 1 = tanh(w / (0.02 w0))
    Modelica.Mechanics.Rotational.Sources.SignTorque friction(tau_nominal = -motor.friction, w0 = 50 * motor.creep);
    Modelica.Mechanics.Rotational.Components.Fixed housing;
    Modelica.Electrical.Analog.Basic.RotationalEMF emf(k = motor.k);
    Modelica.Electrical.Analog.Basic.Resistor resistor(R = motor.R);
    Modelica.Electrical.Analog.Basic.Inductor inductor(L = motor.L, i(fixed = true));
    Modelica.Electrical.Analog.Sources.SignalVoltage amplifier;
    Modelica.Electrical.Analog.Basic.Ground ground;
    Modelica.Blocks.Continuous.PI current_loop(
      k = gains.proportional, T = gains.proportional / gains.integral, initType = Modelica.Blocks.Types.Init.InitialState);
    // From flange to signals: angle and rate go to the testbed. The acceleration is not needed.
    Modelica.Mechanics.Rotational.Components.GeneralTorqueToAngleAdaptor wrist(use_pder2 = false);
  equation
    current_loop.u =
      (gains.stiffness * (theta_ref - rotor.phi) + gains.damping * (omega_ref - rotor.w)) / motor.k - inductor.i;
    connect(current_loop.y, amplifier.v);
    connect(amplifier.n, ground.p);
    connect(amplifier.p, resistor.p);
    connect(resistor.n, inductor.p);
    connect(inductor.n, emf.p);
    connect(emf.n, ground.p);
    connect(emf.flange, rotor.flange_a);
    connect(bearing.flange_a, rotor.flange_a);
    connect(bearing.flange_b, housing.flange);
    connect(friction.flange, rotor.flange_a);
    connect(rotor.flange_b, wrist.flange);
    connect(wrist.p, theta);
    connect(wrist.pder, omega);
    // The adaptor's input f is the torque that flows into its flange, so it has the opposite sign.
    wrist.f = -tau;
  end DriveOfLibrary;

  model MachineOfLibrary "Two drives of the Modelica library and the wrist"
    prw_testbed_me_FMU testbed;
    Move move;
    DriveOfLibrary drive1;
    DriveOfLibrary drive2;
  equation
    drive1.theta_ref = move.theta[1];
    drive1.omega_ref = move.omega[1];
    drive2.theta_ref = move.theta[2];
    drive2.omega_ref = move.omega[2];
    connect(drive1.theta, testbed.theta1);
    connect(drive1.omega, testbed.omega1);
    connect(drive2.theta, testbed.theta2);
    connect(drive2.omega, testbed.omega2);
    connect(testbed.tau1, drive1.tau);
    connect(testbed.tau2, drive2.tau);
  end MachineOfLibrary;

end TorqueDriven;
