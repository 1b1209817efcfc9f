//! The program as its users run it: arguments in; files, lines and an exit code out.

mod backends;
mod commands;
mod comparison;
mod crashes;
mod damage;
mod destinations;
mod examples;
mod failures;
mod memory;
mod workplace;
mod world;
