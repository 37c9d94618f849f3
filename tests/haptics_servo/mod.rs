//! The servo loop: what the hand feels, and that it is never hurt.

mod bone;
mod engine;
mod exchange;
mod pace;
mod passivity;
mod proxy;
mod safety;
mod scene;
mod thread;
