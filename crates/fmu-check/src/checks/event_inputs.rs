//! Checks that inputs that are set in Event Mode have an effect, in Model Exchange and in Co-Simulation.

use super::integration::{Integrated, integrate_with_events};
use super::snapshots::{Snapshot, Unknowns};
use crate::checker::Checker;
use crate::values::inputs_by;
use crate::writer::Part::Begin;
use crate::writer::{Point, Trajectory, Writer};

/// Pairs of arguments of `inputs_by`, for the inputs that are set in Event Mode and for the inputs that are set after it. `None`
/// sets no inputs. Before Event Mode, the inputs are set with 0.5. The changes are so small that an increase and a decrease are
/// unlikely to both cause an event.
const VARIANTS: [(Option<f64>, Option<f64>); 5] =
    [(None, None), (Some(0.501), None), (None, Some(0.501)), (Some(0.499), None), (None, Some(0.499))];

/// Sets the inputs for an argument of `inputs_by`.
fn set_by(writer: &mut Writer, by: Option<f64>) {
    if let Some(by) = by {
        writer.set(0, &inputs_by(writer.description, by));
    }
}

/// Checks that inputs that are set in Event Mode of Model Exchange affect the unknowns, if inputs that are set after Event Mode
/// affect them.
pub fn integrated(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let unknowns = Unknowns { directional: None, indicators: 0, ..Unknowns::new(checker, trajectory) };
    let Integrated { trajectory, chosen } = &integrate_with_events(checker, trajectory)?;
    for index in chosen.iter().copied().take(2) {
        let point = &trajectory.points[index];
        let mut writer = checker.writer(trajectory);
        let snapshots = VARIANTS.map(|(in_event, after)| {
            writer.write(0, &[Begin]);
            trajectory.points[..index].iter().for_each(|point| drop(writer.point(0, point)));
            writer.point(0, &Point { event: false, ..point.clone() });
            writer.call(0, "EnterEventMode", vec![]);
            set_by(&mut writer, in_event);
            writer.update(0);
            writer.call(0, "EnterContinuousTimeMode", vec![]);
            set_by(&mut writer, after);
            let snapshot = unknowns.read(&mut writer);
            writer.free(0);
            snapshot
        });
        has_effect(checker, &unknowns, writer, snapshots)?;
    }
    Ok(())
}

/// If an unknown changes when inputs are set after Event Mode, checks that it also changes when they are set in Event Mode. There is a
/// snapshot for each of `VARIANTS`.
fn has_effect(
    checker: &Checker,
    unknowns: &Unknowns,
    writer: Writer,
    snapshots: [Snapshot; VARIANTS.len()],
) -> anyhow::Result<()> {
    let description = checker.description.clone();
    let names = unknowns.names(&description);
    let unknowns = Unknowns { variables: unknowns.variables.clone(), directional: None, ..*unknowns };
    checker.check("dynamics.event-inputs", writer.sequence, move |run| {
        let all = snapshots.each_ref().map(|snapshot| unknowns.numbers(&description, run, snapshot));
        names.iter().enumerate().find_map(|(index, name)| {
            let [unchanged, up_in_event, up_after, down_in_event, down_after] =
                all.each_ref().map(|numbers| numbers[index]);
            let unchanged = unchanged?;
            let (up_after, down_after) = (up_after?, down_after?);
            // Opposite changes of the inputs have opposite effects; the errors of an iterative solver do not.
            let (effect, opposite) = (up_after - unchanged, down_after - unchanged);
            let has_effect = effect.abs() > 1e-6 * up_after.abs().max(unchanged.abs())
                && (effect + opposite).abs() < 0.2 * effect.abs();
            (up_in_event? == unchanged && down_in_event? == unchanged && has_effect).then(|| {
                format!(
                    "{name} is {unchanged:?}, also after inputs were set in Event Mode; set in the mode after it, they make it {up_after:?}"
                )
            })
        })
    })
}

/// Checks that inputs that are set in Event Mode of Co-Simulation affect the outputs after the next step, if inputs that are set
/// in Step Mode affect them.
pub fn stepped(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let Some(Point { size, .. }) = trajectory.points.first() else { return Ok(()) };
    let unknowns =
        Unknowns { directional: None, indicators: 0, states: 0, ..Unknowns::new(checker, trajectory) };
    let mut writer = checker.writer(trajectory);
    let snapshots = VARIANTS.map(|(in_event, after)| {
        writer.make_with(0, |make| make.event_mode = true);
        set_by(&mut writer, Some(0.5));
        writer.enter(0);
        writer.call(0, "ExitInitializationMode", vec![]);
        for number in 0..4 {
            if number > 0 {
                writer.step(0, description.start_time + f64::from(number - 1) * size, *size);
                writer.call(0, "EnterEventMode", vec![]);
            }
            // The inputs change in the event before the last step.
            set_by(&mut writer, in_event.filter(|_| number == 2));
            writer.update(0);
            writer.call(0, "EnterStepMode", vec![]);
            set_by(&mut writer, after.filter(|_| number == 2));
        }
        let snapshot = unknowns.read(&mut writer);
        writer.free(0);
        snapshot
    });
    has_effect(checker, &unknowns, writer, snapshots)
}
