//! Tests across modules.

mod failed_step;
mod inconsistent_friction;
mod iterated_far_field;
mod pressure;
