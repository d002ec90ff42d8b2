//! The functions as a table of pointers: what an importer has of a library.

use super::types::*;
use crate::export::Exported;

macro_rules! pointers {
    ($($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+) => {
        /// Pointers to the 44 functions of FMI 2.0.
        ///
        /// Those of a model in the same program come from [`of`](Self::of), those of a library from a loader.
        #[allow(missing_docs, reason = "each has the name of its function")]
        #[derive(Clone, Copy, Debug)]
        pub struct Functions {
            pub fmi2GetTypesPlatform: extern "C" fn() -> fmi2String,
            pub fmi2GetVersion: extern "C" fn() -> fmi2String,
            pub fmi2Instantiate: unsafe extern "C" fn(
                fmi2String,
                fmi2Type,
                fmi2String,
                fmi2String,
                *const fmi2CallbackFunctions,
                fmi2Boolean,
                fmi2Boolean,
            ) -> fmi2Component,
            pub fmi2FreeInstance: unsafe extern "C" fn(fmi2Component),
            $(pub $function: unsafe extern "C" fn(fmi2Component $(, $type)*) -> Status,)+
        }

        impl Functions {
            /// Those of a model in this program.
            pub fn of<M: Exported>() -> Self {
                Self {
                    fmi2GetTypesPlatform: super::fmi2GetTypesPlatform,
                    fmi2GetVersion: super::fmi2GetVersion,
                    fmi2Instantiate: super::fmi2Instantiate::<M>,
                    fmi2FreeInstance: super::fmi2FreeInstance::<M>,
                    $($function: super::$function::<M>,)+
                }
            }
        }
    };
}

fmi2_functions!(pointers);
