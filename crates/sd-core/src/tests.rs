//! Tests across modules.

mod failed_step;
mod hydrodynamic_pressure;
mod inconsistent_friction;
mod iterated_far_field;
mod pressure;
