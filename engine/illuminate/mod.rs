//! illuminate
