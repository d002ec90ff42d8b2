//! Saved states of all instances.

use super::entry::{Entry, each};
use super::{Instances, Mask};
use crate::error::{Error, lock, request};
use crate::system_instance::Saved;

/// States that [`Instances`] have saved, one for each instance that had not failed. They contain indices instead of pointers, so
/// restoring them in other instances by mistake cannot corrupt memory. [`forget`](Instances::forget) consumes the value, so freed
/// states cannot be used.
///
/// ```compile_fail,E0382
/// fn restore_a_freed_state(instances: &mut fmu_run::Instances) {
///     let states = instances.save().unwrap();
///     instances.forget(states);
///     instances.restore(&states, None);
/// }
/// ```
#[derive(Debug, PartialEq)]
pub struct States(Vec<Option<(Saved, f64)>>);

impl Instances {
    /// Saves the state of each instance.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the FMU does not support it.
    pub fn save(&mut self) -> Result<States, Error> {
        let why = "cannot save its state (canGetAndSetFMUstate is not true)";
        self.system.check_offer(self.interface, |offer| offer.saves_states, why)?;
        let mut states = vec![None; self.len()];
        let indices = std::sync::Mutex::new(&mut states);
        self.alive(None, |index, progress, instance| {
            let saved = (instance.save()?, progress.time);
            lock(&indices)[index] = Some(saved);
            Ok(())
        });
        Ok(States(states))
    }

    /// Restores states that these instances have saved. Instances without a saved state stay as they are.
    ///
    /// # Errors
    /// Returns [`Error::Request`] and restores nothing if an instance has been created again since the states were saved.
    /// [`reset`](Self::reset) creates an instance again if the FMU rejects the reset, or has returned `fmi2Fatal` or `fmi3Fatal`.
    ///
    /// # Panics
    /// Panics if the number of states differs from the number of instances.
    pub fn restore(&mut self, states: &States, mask: Mask) -> Result<(), Error> {
        assert_eq!(states.0.len(), self.len(), "states of other instances");
        for (index, one) in
            self.all.iter().enumerate().filter(|(index, _)| mask.is_none_or(|mask| mask[*index]))
        {
            if let (Some((saved, _)), Some(instance)) = (states.0[index], &one.instance) {
                instance
                    .check_own(saved)
                    .map_err(|why| Error::Request(format!("instance {index}: {why}")))?;
            }
        }
        let back = |index: usize, one: &mut Entry| {
            let (Some((saved, time)), Some(instance)) = (states.0[index], &mut one.instance) else { return };
            match instance.restore(saved) {
                Ok(()) => (one.progress.time, one.error) = (time, None),
                Err(rejection) => one.error = Some(rejection.to_string()),
            }
        };
        each(&mut self.threads, &mut self.all, mask, back);
        Ok(())
    }

    /// Frees saved states.
    pub fn forget(&mut self, states: States) {
        for (one, saved) in self.all.iter_mut().zip(states.0) {
            if let (Some((saved, _)), Some(instance)) = (saved, &mut one.instance) {
                _ = instance.forget(saved);
            }
        }
    }

    /// Serializes saved states to bytes, which another process can de-serialize. An entry is `None` if the instance has no saved
    /// state, or if its FMU returns an error.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the FMU does not support it, or if an instance has been created again since the states were saved.
    pub fn serialize(&mut self, states: &States) -> Result<Vec<Option<Vec<u8>>>, Error> {
        let why = "cannot serialize its state (canSerializeFMUstate is not true)";
        self.system.check_offer(self.interface, |offer| offer.serializes_states, why)?;
        for (index, (one, saved)) in self.all.iter().zip(&states.0).enumerate() {
            if let (Some((saved, _)), Some(instance)) = (saved, &one.instance) {
                instance
                    .check_own(*saved)
                    .map_err(|why| Error::Request(format!("instance {index}: {why}")))?;
            }
        }
        let bytes = self.all.iter_mut().zip(&states.0).map(|(one, saved)| {
            let ((saved, time), instance) = (saved.as_ref()?, one.instance.as_mut()?);
            match instance.serialize(*saved) {
                Ok(bytes) => Some([&time.to_le_bytes()[..], &bytes].concat()),
                Err(rejection) => {
                    one.error = Some(rejection.to_string());
                    None
                }
            }
        });
        Ok(bytes.collect())
    }

    /// De-serializes states that [`serialize`](Self::serialize) returned, one or `None` for each instance.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the FMU does not support it or the number of states is wrong, and [`Error::Fmu`] if an
    /// instance rejects a state.
    pub fn deserialize(&mut self, bytes: &[Option<impl AsRef<[u8]>>]) -> Result<States, Error> {
        if bytes.len() != self.len() {
            return request(format!("there are {} states for {} instances", bytes.len(), self.len()));
        }
        let why = "cannot deserialize a state (canSerializeFMUstate is not true)";
        self.system.check_offer(self.interface, |offer| offer.serializes_states, why)?;
        let mut states = Vec::new();
        for (index, (one, bytes)) in self.all.iter_mut().zip(bytes).enumerate() {
            let Some(bytes) = bytes else {
                states.push(None);
                continue;
            };
            let Some((time, bytes)) = bytes.as_ref().split_first_chunk() else {
                return request(format!("the state of instance {index} is cut short"));
            };
            let instance = one.instance.as_mut();
            let read = instance.map(|instance| instance.deserialize(bytes)).transpose();
            let saved = read.map_err(|rejection| Error::Fmu(format!("instance {index}: {rejection}")))?;
            states.push(saved.map(|saved| (saved, f64::from_le_bytes(*time))));
        }
        Ok(States(states))
    }
}
