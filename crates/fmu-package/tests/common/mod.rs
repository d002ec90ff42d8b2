//! Models of a test, which describe themselves as libraries do.
#![allow(dead_code, missing_docs, unsafe_code)]

use anyhow::Result;
use fmu_export::Exported;
use fmu_package::structure::ModelStructure;
use fmu_package::{Changes, LoadedModel};

pub fn model<M: Exported>() -> LoadedModel {
    let (fmi2, fmi3) = (fmu_export::fmi2::functions::<M>(), fmu_export::fmi3::functions::<M>());
    // SAFETY: the functions of the same model.
    unsafe { LoadedModel::new(&fmu_export::describe::<M>(), fmi2, fmi3) }.unwrap()
}

pub fn structure<M: Exported>(tunable: bool) -> Result<ModelStructure> {
    ModelStructure::of(&model::<M>(), tunable)
}

pub mod fmi2 {
    use super::*;

    pub fn describe<M: Exported>(changes: &Changes) -> Result<String> {
        fmu_package::fmi2::describe(&model::<M>(), changes)
    }
}

pub mod fmi3 {
    use super::*;

    pub fn describe<M: Exported>(changes: &Changes) -> Result<String> {
        fmu_package::fmi3::describe(&model::<M>(), changes)
    }
}
