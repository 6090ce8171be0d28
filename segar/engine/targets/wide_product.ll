; LLVM knows the upper half of a product of 64-bit numbers when it sees one, and calls this function for it, which it has
; for other processors: the product of two integers of 128 bits, each in two halves, from products of halves of 32 bits.
define void @__multi3(ptr %out, i64 %a, i64 %a2, i64 %b, i64 %b2) {
  %a0 = and i64 %a, 4294967295
  %a1 = lshr i64 %a, 32
  %b0 = and i64 %b, 4294967295
  %b1 = lshr i64 %b, 32
  %p00 = mul i64 %a0, %b0
  %p01 = mul i64 %a0, %b1
  %p10 = mul i64 %a1, %b0
  %p11 = mul i64 %a1, %b1
  %c = lshr i64 %p00, 32
  %m0 = and i64 %p01, 4294967295
  %m1 = and i64 %p10, 4294967295
  %s0 = add i64 %c, %m0
  %s = add i64 %s0, %m1
  %low = mul i64 %a, %b
  %h0 = lshr i64 %p01, 32
  %h1 = lshr i64 %p10, 32
  %h2 = lshr i64 %s, 32
  %h3 = add i64 %p11, %h0
  %h4 = add i64 %h3, %h1
  %h5 = add i64 %h4, %h2
  %x0 = mul i64 %a, %b2
  %x1 = mul i64 %a2, %b
  %h6 = add i64 %h5, %x0
  %high = add i64 %h6, %x1
  store i64 %low, ptr %out
  %place = getelementptr i8, ptr %out, i32 8
  store i64 %high, ptr %place
  ret void
}
