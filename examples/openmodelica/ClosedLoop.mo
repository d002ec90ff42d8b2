// The closed loop in OpenModelica: both FMUs, imported for Model Exchange, wired to each other. closed_loop.mos imports them and
// runs this.
//
// A test compares the wires with those of prw_closed_loop.ssp; the names are those that OpenModelica's import gives.

model ClosedLoop "The wrist goes to a pitch and a roll angle"
  parameter Real pitch_ref = 0.5235987755982988 "Pitch angle to go to, rad";
  parameter Real roll_ref = 1.0471975511965976 "Roll angle to go to, rad";
  prw_controller_me_FMU controller;
  prw_testbed_me_FMU testbed;
  discrete Real y[6](each fixed = true) "What the controller sees: the testbed as it was just before the sample";
equation
  controller.pitch_ref = pitch_ref;
  controller.roll_ref = roll_ref;
  connect(controller.theta1, testbed.theta1);
  connect(controller.theta2, testbed.theta2);
  // In Model Exchange the rates are not derived from the angles: without these two the dampers hold the shafts back.
  connect(controller.omega1, testbed.omega1);
  connect(controller.omega2, testbed.omega2);
  // Sampled, not connected. To OpenModelica all outputs of an FMU depend on all of its inputs: with six connections the two make
  // a nonlinear system of size 24, solved at every step, and take 50 times as long. Without `pre` the model does not build.
  when sample(0, controller.sample_time) then
    y = {pre(testbed.pitch), pre(testbed.roll), pre(testbed.pitch_rate), pre(testbed.roll_rate), pre(testbed.tau1), pre(testbed.tau2)};
  end when;
  {controller.pitch, controller.roll, controller.pitch_rate, controller.roll_rate, controller.tau1, controller.tau2} = y;
end ClosedLoop;
