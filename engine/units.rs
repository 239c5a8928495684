//! Quantities with units: "150 um", "30 keV", "0.93 g/cm3", "12 deg".
