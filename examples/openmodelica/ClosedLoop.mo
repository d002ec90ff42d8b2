// The closed loop in OpenModelica: both FMUs, imported for Model Exchange and connected. closed_loop.mos imports the FMUs and
// simulates this model.
//
// A test compares the connections with prw_closed_loop.ssp. OpenModelica's import chooses the names of the two classes.

model ClosedLoop "The wrist moves to a pitch and a roll angle"
  parameter Real pitch_ref = 0.5235987755982988 "Pitch reference, rad";
  parameter Real roll_ref = 1.0471975511965976 "Roll reference, rad";
  prw_controller_me_FMU controller;
  prw_testbed_me_FMU testbed;
  discrete Real y[6](each fixed = true) "Inputs of the controller: outputs of the testbed just before the sample";
equation
  controller.pitch_ref = pitch_ref;
  controller.roll_ref = roll_ref;
  connect(controller.theta1, testbed.theta1);
  connect(controller.theta2, testbed.theta2);
  // In Model Exchange the FMU does not derive the rates from the angles. Without these two connections OpenModelica reports too few
  // equations; with rates of zero the dampers would brake the shafts.
  connect(controller.omega1, testbed.omega1);
  connect(controller.omega2, testbed.omega2);
  // These values are sampled, not connected. OpenModelica assumes that all outputs of an FMU depend on all of its inputs. Six
  // connections would give a nonlinear system of size 24, which is solved at every step and takes 50 times as long. Without `pre`
  // OpenModelica cannot build the model.
  when sample(0, controller.sample_time) then
    y = {pre(testbed.pitch), pre(testbed.roll), pre(testbed.pitch_rate), pre(testbed.roll_rate), pre(testbed.tau1), pre(testbed.tau2)};
  end when;
  {controller.pitch, controller.roll, controller.pitch_rate, controller.roll_rate, controller.tau1, controller.tau2} = y;
end ClosedLoop;
