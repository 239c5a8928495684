//! Random numbers that are a pure function of a seed and a place: the same bits in any order of
//! work and on any number of threads.

mod normal;
mod philox;

pub(crate) use philox::Draws;
