//! Drilling against closed forms: how much is removed, in what shape, and that it comes back.

mod distances;
mod history;
mod odd;
mod phantom;
mod rates;
mod saved;
mod shapes;
