//! What fits of illumination curves read.

shared_structs! {
    /// Structs of the fits.
    pub(super) LAYOUTS;

    /// A mask step of a fit, in half widths of the scan from its centre.
    pub struct Step in Steps(readonly) {
        pub offset: f32,
        /// Difference of the f64 from the f32 above.
        pub offset_low: f32,
        /// Share of the scan that the step stands for.
        pub width: f32,
    }

    /// Push constants of `retrieve/fit.comp`.
    pub struct FitPush {
        pub steps: u64 => Steps,
        /// `[step][pixel]`.
        pub curves: u64 => Curves,
        /// `[value][pixel]`.
        pub fits: u64 => Fits,
        pub step_count: u32,
        pub pixel_count: u32,
        /// Pixel of this dispatch.
        pub first: u32,
        /// Weights of counts, from the fit.
        pub poisson: u32,
        /// Value of one count, for the variance of weighted fits.
        pub gain: f32,
        /// Values from here on are left out.
        pub saturation: f32,
        /// Least width that counts as one.
        pub min_width: f32,
        /// Most width that counts as one.
        pub max_width: f32,
        /// 1 where the background is an unknown.
        pub background_is_free: u32,
        /// Background beside the share of the area.
        pub background: f32,
        /// Background over the product of height and width.
        pub background_per_area: f32,
    }
}
