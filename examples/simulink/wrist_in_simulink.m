function wrist_in_simulink(directory)
% Runs the testbed's FMU in Simulink, and compares the results with the reference experiments in the FMU.
%
%     wrist_in_simulink('../../target/fmu')
%
% The directory contains prw_testbed.fmu and prw_controller.fmu (`make closed-loop-fmus`, or from a release). The script needs
% Simulink R2023a or later, which has the block FMU, and the command `prw` on the system's path (python/prw/README.md). The
% script was written from documentation and has not been run in Simulink. Please report your results.

if nargin < 1
    directory = fullfile('..', '..', 'target', 'fmu');
end
% The block needs the name of a file on MATLAB's path.
addpath(directory);
restore = onCleanup(@() rmpath(directory));

fig4();
closed_loop();
end

function fig4()
% Fig. 4 with opposite motor rates: angles and rates from the workspace, all outputs to the file fig4.mat.
model = fresh('wrist_fig4');
testbed = add_fmu(model, 'prw_testbed.fmu');
t = (0:1e-3:1)';
rate = sin(10 * pi * t);
angle = 2 * sin(5 * pi * t).^2 / (10 * pi);
motors = struct('theta1', angle, 'theta2', -angle, 'omega1', rate, 'omega2', -rate);
names = fieldnames(motors);
workspace = get_param(model, 'ModelWorkspace');
for k = 1:numel(names)
    assignin(workspace, names{k}, [t motors.(names{k})]);
    add_block('simulink/Sources/From Workspace', [model '/' names{k}], ...
              'VariableName', names{k}, 'SampleTime', '0.001');
    add_line(model, [names{k} '/1'], port(testbed, 'input', names{k}));
end
add_outports(model, testbed);
simulate(model, 'fig4_opposite');
end

function closed_loop()
% The controller drives the testbed to a pitch of 30 and a roll of 60 degrees.
model = fresh('wrist_closed_loop');
testbed = add_fmu(model, 'prw_testbed.fmu');
controller = add_fmu(model, 'prw_controller.fmu');
goals = struct('pitch_ref', pi / 6, 'roll_ref', pi / 3);
names = fieldnames(goals);
for k = 1:numel(names)
    add_block('simulink/Sources/Constant', [model '/' names{k}], 'Value', num2str(goals.(names{k}), 17));
    add_line(model, [names{k} '/1'], port(controller, 'input', names{k}));
end
for name = {'theta1', 'theta2', 'omega1', 'omega2'}
    add_line(model, port(controller, 'output', name{1}), port(testbed, 'input', name{1}));
end
% Pitch, roll and their rates do not depend on the motors at the same instant, so they are connected directly.
for name = {'pitch', 'roll', 'pitch_rate', 'roll_rate'}
    add_line(model, port(testbed, 'output', name{1}), port(controller, 'input', name{1}));
end
% The torques do (eq. 9). If Simulink assumes direct feedthrough of the controller, these two connections close an algebraic
% loop. A delay of one step breaks the loop. The controller uses the torques only to stay below their limit.
for name = {'tau1', 'tau2'}
    delay = ['delay_' name{1}];
    add_block('simulink/Discrete/Unit Delay', [model '/' delay], 'SampleTime', '0.001');
    add_line(model, port(testbed, 'output', name{1}), [delay '/1']);
    add_line(model, [delay '/1'], port(controller, 'input', name{1}));
end
add_outports(model, testbed);
simulate(model, 'closed_loop');
end

function model = fresh(model)
% Creates an empty model with a fixed step of 1 ms.
if bdIsLoaded(model)
    close_system(model, 0);
end
new_system(model);
set_param(model, 'SolverType', 'Fixed-step', 'Solver', 'FixedStepDiscrete', 'FixedStep', '0.001', 'StopTime', '1');
end

function fmu = add_fmu(model, file)
% Adds the FMU as a block with steps of 1 ms. Returns its name, and the names of its ports in their order.
[~, fmu.name] = fileparts(file);
fmu.block = [model '/' fmu.name];
load_system('simulink_extras');
add_block('simulink_extras/FMU Import/FMU', fmu.block);
set_param(fmu.block, 'FMUName', file);
set_param(fmu.block, 'FMUMode', 'CoSimulation', 'FMUSampleTime', '0.001');
set_param(fmu.block, 'FMUInputMapping', 'Flat', 'FMUOutputMapping', 'Flat');
if strcmp(fmu.name, 'prw_testbed')
    % The motors' rates are connected, so the testbed need not estimate them from the angles.
    set_param(fmu.block, 'use_omega', 'on');
end
unpacked = tempname;
unzip(which(file), unpacked);
removed = onCleanup(@() rmdir(unpacked, 's'));
variables = xmlread(fullfile(unpacked, 'modelDescription.xml')).getElementsByTagName('ScalarVariable');
fmu.input = {};
fmu.output = {};
for k = 0:variables.getLength - 1
    variable = variables.item(k);
    causality = char(variable.getAttribute('causality'));
    if any(strcmp(causality, {'input', 'output'}))
        fmu.(causality){end + 1} = char(variable.getAttribute('name'));
    end
end
end

function text = port(fmu, causality, name)
% Returns a port of the FMU's block in the format of add_line.
text = sprintf('%s/%d', fmu.name, find(strcmp(fmu.(causality), name)));
end

function add_outports(model, fmu)
% Adds an outport of the model for each output, because Simulink may optimize unconnected signals away.
for k = 1:numel(fmu.output)
    add_block('simulink/Sinks/Out1', [model '/' fmu.output{k}]);
    add_line(model, sprintf('%s/%d', fmu.name, k), [fmu.output{k} '/1']);
end
end

function simulate(model, experiment)
% Runs the model, saves time and all outputs for prw check, and compares them with the reference.
out = sim(model, 'SaveOutput', 'on', 'OutputSaveName', 'yout', 'SaveFormat', 'StructureWithTime', ...
          'ReturnWorkspaceOutputs', 'on');
yout = out.yout;
file = [model '.mat'];
save(file, 'yout', '-v7');
system(sprintf('prw check %s --experiment %s', file, experiment));
end
