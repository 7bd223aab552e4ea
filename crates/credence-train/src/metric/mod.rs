//! Training and evaluation of the seed's metric embedding.

mod cloud;
mod evaluate;
mod fitness;
mod losses;
