//! The functions as a table of pointers: what an importer has of a library.

use super::types::*;
use crate::export::Exported;

macro_rules! pointers {
    ($($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+) => {
        /// Pointers to the functions of FMI 3.0.
        ///
        /// Those of a model in the same program come from [`of`](Self::of), those of a library from a loader.
        #[allow(missing_docs, reason = "each has the name of its function")]
        #[derive(Clone, Copy, Debug)]
        pub struct Functions {
            pub fmi3GetVersion: extern "C" fn() -> fmi3String,
            pub fmi3InstantiateModelExchange: unsafe extern "C" fn(
                fmi3String,
                fmi3String,
                fmi3String,
                fmi3Boolean,
                fmi3Boolean,
                fmi3InstanceEnvironment,
                Option<fmi3LogMessageCallback>,
            ) -> fmi3Instance,
            pub fmi3InstantiateCoSimulation: unsafe extern "C" fn(
                fmi3String,
                fmi3String,
                fmi3String,
                fmi3Boolean,
                fmi3Boolean,
                fmi3Boolean,
                fmi3Boolean,
                *const fmi3ValueReference,
                usize,
                fmi3InstanceEnvironment,
                Option<fmi3LogMessageCallback>,
                Option<fmi3IntermediateUpdateCallback>,
            ) -> fmi3Instance,
            pub fmi3InstantiateScheduledExecution: unsafe extern "C" fn(
                fmi3String,
                fmi3String,
                fmi3String,
                fmi3Boolean,
                fmi3Boolean,
                fmi3InstanceEnvironment,
                Option<fmi3LogMessageCallback>,
                Option<fmi3ClockUpdateCallback>,
                Option<fmi3LockPreemptionCallback>,
                Option<fmi3UnlockPreemptionCallback>,
            ) -> fmi3Instance,
            pub fmi3FreeInstance: unsafe extern "C" fn(fmi3Instance),
            $(pub $function: unsafe extern "C" fn(fmi3Instance $(, $type)*) -> Status,)+
        }

        impl Functions {
            /// Those of a model in this program.
            pub fn of<M: Exported>() -> Self {
                Self {
                    fmi3GetVersion: super::fmi3GetVersion,
                    fmi3InstantiateModelExchange: super::fmi3InstantiateModelExchange::<M>,
                    fmi3InstantiateCoSimulation: super::fmi3InstantiateCoSimulation::<M>,
                    fmi3InstantiateScheduledExecution: super::fmi3InstantiateScheduledExecution::<M>,
                    fmi3FreeInstance: super::fmi3FreeInstance::<M>,
                    $($function: super::$function::<M>,)+
                }
            }
        }
    };
}

fmi3_functions!(pointers);
