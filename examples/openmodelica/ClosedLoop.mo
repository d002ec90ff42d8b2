// The closed loop in OpenModelica: both FMUs, imported for Model Exchange, wired to each other. closed_loop.mos imports them and
// runs this.
//
// OpenModelica has not seen this file yet: where it was written there is none. A test compares the wires with those of
// prw_closed_loop.ssp, which other tools have run; the names are those that OpenModelica's import was seen to give.

model ClosedLoop "The wrist goes to a pitch and a roll angle"
  parameter Real pitch_ref = 0.5235987755982988 "Pitch angle to go to, rad";
  parameter Real roll_ref = 1.0471975511965976 "Roll angle to go to, rad";
  prw_controller_me_FMU controller;
  prw_testbed_me_FMU testbed;
equation
  controller.pitch_ref = pitch_ref;
  controller.roll_ref = roll_ref;
  connect(controller.theta1, testbed.theta1);
  connect(controller.theta2, testbed.theta2);
  // In Model Exchange the rates are not derived from the angles: without these two the dampers hold the shafts back.
  connect(controller.omega1, testbed.omega1);
  connect(controller.omega2, testbed.omega2);
  connect(testbed.pitch, controller.pitch);
  connect(testbed.roll, controller.roll);
  connect(testbed.pitch_rate, controller.pitch_rate);
  connect(testbed.roll_rate, controller.roll_rate);
  connect(testbed.tau1, controller.tau1);
  connect(testbed.tau2, controller.tau2);
end ClosedLoop;
